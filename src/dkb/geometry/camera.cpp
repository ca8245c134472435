// SPDX-License-Identifier: Apache-2.0
#include "dkb/geometry/camera.h"

#include <cmath>

#include "dkb/util/errors.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

// [s] Colour camera of the first Kinect and its kin. Chosen by the reprojection and pose errors of TUM fr1_xyz; Ringaby
// and Forssen (ICCV 2011) measured 26 ms with a rig.
constexpr double kKinectReadout = 0.020;

}  // namespace

void CameraModel::check() const {
  require_option(width >= 16 && width <= 16384, "width", width, "16 ... 16384 px");
  require_option(height >= 16 && height <= 16384, "height", height, "16 ... 16384 px");
  require_option(std::isfinite(fx) && fx > 0, "fx", fx, "greater than 0 px");
  require_option(std::isfinite(fy) && fy > 0, "fy", fy, "greater than 0 px");
  require_option(std::isfinite(cx) && cx > 0 && cx < width, "cx", cx, "inside the image (0 ... width)");
  require_option(std::isfinite(cy) && cy > 0 && cy < height, "cy", cy, "inside the image (0 ... height)");
  require_option(std::isfinite(k1), "k1", k1, "finite");
  require_option(std::isfinite(k2), "k2", k2, "finite");
  require_option(std::isfinite(p1), "p1", p1, "finite");
  require_option(std::isfinite(p2), "p2", p2, "finite");
  require_option(std::isfinite(k3), "k3", k3, "finite");
  require_option(std::isfinite(depth_factor) && depth_factor > 0, "depth_factor", depth_factor,
                 "greater than 0 units per metre");
  require_option(std::isfinite(fps) && fps >= 0 && fps <= 1000, "fps", fps, "0 ... 1000 per second");
  require_option(std::isfinite(readout) && readout >= 0 && readout <= 0.1, "readout", readout, "0 ... 0.1 s");
  require_option(std::isfinite(depth_min) && depth_min >= 0, "depth_min", depth_min, "at least 0 m");
  require_option(std::isfinite(depth_max) && depth_max > depth_min, "depth_max", depth_max, "greater than depth_min");
}

Eigen::Vector2d CameraModel::distort(const Eigen::Vector2d& ideal_pixel) const {
  const double x = (ideal_pixel.x() - cx) / fx, y = (ideal_pixel.y() - cy) / fy;
  const double r2 = x * x + y * y;
  const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  const double yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  return {fx * xd + cx, fy * yd + cy};
}

Eigen::Vector2d CameraModel::undistort(const Eigen::Vector2d& image_pixel) const {
  if (!distorted()) return image_pixel;
  const double xd = (image_pixel.x() - cx) / fx, yd = (image_pixel.y() - cy) / fy;
  double x = xd, y = yd;
  for (int i = 0; i < 20; ++i) {
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
    if (!(std::abs(radial) > 1e-3)) return image_pixel;  // outside the range where the model can be inverted
    const double nx = (xd - 2.0 * p1 * x * y - p2 * (r2 + 2.0 * x * x)) / radial;
    const double ny = (yd - p1 * (r2 + 2.0 * y * y) - 2.0 * p2 * x * y) / radial;
    const bool settled = std::abs(nx - x) + std::abs(ny - y) < 1e-10;
    x = nx;
    y = ny;
    if (settled) break;
  }
  return {fx * x + cx, fy * y + cy};
}

namespace {

// Whether the image moves outwards with a ray all the way from the axis to a squared tangent u of its angle: the slope
// 1 + 3 k1 u + 5 k2 u^2 + 7 k3 u^3 of the radial polynomial is positive there and where it is least before.
bool unfolded(const CameraModel& c, double u) {
  const auto slope = [&](double at) { return 1 + at * (3 * c.k1 + at * (5 * c.k2 + at * 7 * c.k3)); };
  if (!(slope(u) > 0)) return false;
  const double root = 25 * c.k2 * c.k2 - 63 * c.k1 * c.k3;  // of a quarter of the discriminant of its derivative
  if (root < 0) return true;
  const double q = -5 * c.k2 - std::copysign(std::sqrt(root), c.k2);
  for (const double least : {q / (21 * c.k3), 3 * c.k1 / q})
    if (least > 0 && least < u && !(slope(least) > 0)) return false;
  return true;
}

}  // namespace

std::optional<Eigen::Vector2d> image_pixel(const CameraModel& camera, const Eigen::Vector3d& point) {
  if (!(point.z() > 0)) return std::nullopt;
  const Eigen::Vector2d ideal = camera.project(point);
  if (!camera.distorted()) return ideal;
  if (!unfolded(camera, (point.head<2>() / point.z()).squaredNorm())) return std::nullopt;
  return camera.distort(ideal);
}

std::optional<CameraModel> builtin_camera(const std::string& name) {
  CameraModel c;
  c.fps = 30;
  if (name == "fr1") {
    c.readout = kKinectReadout;
    c.fx = 517.3, c.fy = 516.5, c.cx = 318.6, c.cy = 255.3;
    c.k1 = 0.2624, c.k2 = -0.9531, c.p1 = -0.0054, c.p2 = 0.0026, c.k3 = 1.1633;
  } else if (name == "fr2") {
    c.readout = kKinectReadout;
    c.fx = 520.9, c.fy = 521.0, c.cx = 325.1, c.cy = 249.7;
    c.k1 = 0.2312, c.k2 = -0.7849, c.p1 = -0.0033, c.p2 = -0.0001, c.k3 = 0.9172;
  } else if (name == "fr3") {
    c.readout = kKinectReadout;
    c.fx = 535.4, c.fy = 539.2, c.cx = 320.1, c.cy = 247.6;
  } else if (name == "bonn") {
    c.fx = 542.822841, c.fy = 542.576870, c.cx = 315.593520, c.cy = 237.756098;
    c.k1 = 0.039903, c.k2 = -0.099343, c.p1 = -0.000730, c.p2 = -0.000144, c.k3 = 0.0;
  } else {
    return std::nullopt;
  }
  return c;
}

Camera Camera::named(const std::string& name) {
  const auto camera = builtin_camera(name);
  if (!camera)
    throw InputError("camera: there is none named \"" + name + "\"" +
                     did_you_mean(name, {"fr1", "fr2", "fr3", "bonn"}) + "; names: fr1, fr2, fr3, bonn");
  return *camera;
}

}  // namespace dkb
