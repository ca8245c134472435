// SPDX-License-Identifier: Apache-2.0
#include "dkb/geometry/camera.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "dkb_slam/image.h"

namespace dkb {
namespace {

// [s] Colour camera of the first Kinect and its kin. Learnt from TUM fr1_xyz and fr1_rpy it is 19 to 25 ms
// (TimingCalibration); Ringaby and Forssen (ICCV 2011) measured 26 ms with a rig.
constexpr double kKinectReadout = 0.0235;
// [s] Its depth images, as TUM's recordings stamp them, show what the colour camera saw so long before: where surfaces
// seen at different times agree best, by our poses, in freiburg1_xyz and freiburg1_rpy (docs/method.md).
constexpr double kKinectDepthOffset = -0.018;

}  // namespace

Eigen::Vector2d CameraModel::distort(const Eigen::Vector2d& ideal_pixel) const {
  const double x = (ideal_pixel.x() - cx) / fx, y = (ideal_pixel.y() - cy) / fy;
  const double r2 = x * x + y * y;
  double radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
  if (rational()) radial /= 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6));
  const double xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
  const double yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
  return {fx * xd + cx, fy * yd + cy};
}

namespace {

// The radial factor is above / below, two polynomials in the squared tangent u of a ray's angle; their slopes. Below is
// 1 in Brown's model.
struct Radial {
  double above, below, above_slope, below_slope;
};
Radial radial_of(const CameraModel& c, double u) {
  return {1 + u * (c.k1 + u * (c.k2 + u * c.k3)), 1 + u * (c.k4 + u * (c.k5 + u * c.k6)),
          c.k1 + u * (2 * c.k2 + u * 3 * c.k3), c.k4 + u * (2 * c.k5 + u * 3 * c.k6)};
}

// The distortion turned round by Newton's method, which serves where the factor is steep, towards the corners of a wide
// lens. Nothing where it does not settle.
std::optional<Eigen::Vector2d> ideal_pixel_of(const CameraModel& c, const Eigen::Vector2d& image_pixel) {
  Eigen::Vector2d at((image_pixel.x() - c.cx) / c.fx, (image_pixel.y() - c.cy) / c.fy);
  const auto pixel_of = [&] { return Eigen::Vector2d(c.fx * at.x() + c.cx, c.fy * at.y() + c.cy); };
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector2d off = image_pixel - c.distort(pixel_of());  // [px]
    if (off.norm() < 1e-9) return pixel_of();
    const double x = at.x(), y = at.y();
    const Radial r = radial_of(c, at.squaredNorm());
    const double radial = r.above / r.below, slope = (r.above_slope - radial * r.below_slope) / r.below;
    Eigen::Matrix2d jacobian;
    const double mixed = 2 * (slope * x * y + c.p1 * x + c.p2 * y);
    jacobian << radial + 2 * slope * x * x + 2 * c.p1 * y + 6 * c.p2 * x, mixed, mixed,
        radial + 2 * slope * y * y + 6 * c.p1 * y + 2 * c.p2 * x;
    if (!(jacobian.determinant() > 1e-6)) return std::nullopt;
    at += jacobian.inverse() * Eigen::Vector2d(off.x() / c.fx, off.y() / c.fy);
  }
  if (!((image_pixel - c.distort(pixel_of())).norm() < 1e-6)) return std::nullopt;
  return pixel_of();
}

// Brown's model turned round by dividing by its factor again and again; nothing where that does not settle. It comes
// before Newton's method since map files hold pixels by how far they are from its answers, to the last bit.
std::optional<Eigen::Vector2d> settled_brown(const CameraModel& c, const Eigen::Vector2d& image_pixel) {
  const double xd = (image_pixel.x() - c.cx) / c.fx, yd = (image_pixel.y() - c.cy) / c.fy;
  double x = xd, y = yd;
  for (int i = 0; i < 20; ++i) {
    const double r2 = x * x + y * y;
    const double radial = 1.0 + r2 * (c.k1 + r2 * (c.k2 + r2 * c.k3));
    const double nx = (xd - 2.0 * c.p1 * x * y - c.p2 * (r2 + 2.0 * x * x)) / radial;
    const double ny = (yd - c.p1 * (r2 + 2.0 * y * y) - 2.0 * c.p2 * x * y) / radial;
    const bool settled = std::abs(nx - x) + std::abs(ny - y) < 1e-10;
    x = nx;
    y = ny;
    if (settled) return Eigen::Vector2d(c.fx * x + c.cx, c.fy * y + c.cy);
  }
  return std::nullopt;
}

}  // namespace

Eigen::Vector2d CameraModel::undistort(const Eigen::Vector2d& image_pixel) const {
  if (!distorted()) return image_pixel;
  if (const auto ideal = rational() ? std::nullopt : settled_brown(*this, image_pixel)) return *ideal;
  return ideal_pixel_of(*this, image_pixel).value_or(image_pixel);
}

namespace {

// unfolded() of the rational model, whose slope is a ratio of longer polynomials: asked at 24 radii. No lens folds and
// unfolds between two of them.
bool rational_unfolded(const CameraModel& c, double u) {
  constexpr int kSteps = 24;
  for (int i = 1; i <= kSteps; ++i) {
    const double at = u * i / kSteps;
    const Radial r = radial_of(c, at);
    if (!(r.below > 0 && r.above * r.below + 2 * at * (r.above_slope * r.below - r.above * r.below_slope) > 0))
      return false;
  }
  return true;
}

// Whether the image moves outwards with a ray all the way from the axis to a squared tangent u of its angle: the slope
// 1 + 3 k1 u + 5 k2 u^2 + 7 k3 u^3 of the radial polynomial is positive there and where it is least before.
bool unfolded(const CameraModel& c, double u) {
  if (c.rational()) return rational_unfolded(c, u);
  const auto slope = [&](double at) { return 1 + at * (3 * c.k1 + at * (5 * c.k2 + at * 7 * c.k3)); };
  if (!(slope(u) > 0)) return false;
  const double root = 25 * c.k2 * c.k2 - 63 * c.k1 * c.k3;  // of a quarter of the discriminant of its derivative
  if (root < 0) return true;
  const double q = -5 * c.k2 - std::copysign(std::sqrt(root), c.k2);
  for (const double least : {q / (21 * c.k3), 3 * c.k1 / q})
    if (least > 0 && least < u && !(slope(least) > 0)) return false;
  return true;
}

// A polynomial folds and a ratio has poles: a calibration that puts either into the image would show walls where there
// are none.
std::optional<Eigen::Vector2d> pixel_without_ray(const CameraModel& c) {
  constexpr int kGrid = 16;  // each ray is asked from the axis outwards, so a coarse grid meets every pole
  for (int row = 0; row <= kGrid; ++row)
    for (int column = 0; column <= kGrid; ++column) {
      const Eigen::Vector2d pixel(column * (c.width - 1.0) / kGrid, row * (c.height - 1.0) / kGrid);
      const std::optional<Eigen::Vector2d> ideal = ideal_pixel_of(c, pixel);
      if (!ideal || !unfolded(c, c.unproject(*ideal, 1).head<2>().squaredNorm())) return pixel;
    }
  return std::nullopt;
}

}  // namespace

std::optional<Eigen::Vector2d> image_pixel(const CameraModel& camera, const Eigen::Vector3d& point) {
  if (!(point.z() > 0)) return std::nullopt;
  const Eigen::Vector2d ideal = camera.project(point);
  if (!camera.distorted()) return ideal;
  if (!unfolded(camera, (point.head<2>() / point.z()).squaredNorm())) return std::nullopt;
  return camera.distort(ideal);
}

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
  require_option(std::isfinite(k4), "k4", k4, "finite");
  require_option(std::isfinite(k5), "k5", k5, "finite");
  require_option(std::isfinite(k6), "k6", k6, "finite");
  require_option(!distorted() || !pixel_without_ray(*this), rational() ? "k4" : "k1", rational() ? k4 : k1,
                 "such that with the other coefficients every pixel has a ray, as through a lens");
  require_option(std::isfinite(depth_factor) && depth_factor > 0, "depth_factor", depth_factor,
                 "greater than 0 units per metre");
  require_option(std::isfinite(fps) && fps >= 0 && fps <= 1000, "fps", fps, "0 ... 1000 per second");
  require_option(std::isfinite(readout) && std::abs(readout) <= 0.1, "readout", readout, "-0.1 ... 0.1 s");
  require_option(std::isfinite(depth_time_offset) && std::abs(depth_time_offset) <= 0.1, "depth_time_offset",
                 depth_time_offset, "-0.1 ... 0.1 s");
  require_option(std::isfinite(depth_min) && depth_min >= 0, "depth_min", depth_min, "at least 0 m");
  require_option(std::isfinite(depth_max) && depth_max > depth_min, "depth_max", depth_max, "greater than depth_min");
  if (!mask) return;
  if (mask->width() != width || mask->height() != height)
    throw InvalidOption("mask", std::to_string(mask->width()) + " x " + std::to_string(mask->height()) + " px",
                        "of the size of the images, " + std::to_string(width) + " x " + std::to_string(height) + " px");
  if (std::none_of(mask->data(), mask->data() + mask->size(), [](uint8_t m) { return m == 0; }))
    throw InvalidOption("mask", "above 0 everywhere", "0 where the images show the world");
}

void CameraModel::set_distortion(const std::string& model, const std::vector<double>& coefficients) {
  CameraModel made = *this;
  double* const fields[] = {&made.k1, &made.k2, &made.p1, &made.p2, &made.k3, &made.k4, &made.k5, &made.k6};
  for (double* field : fields) *field = 0;
  const auto all_zero = [&](size_t first) {
    return std::all_of(coefficients.begin() + static_cast<std::ptrdiff_t>(std::min(first, coefficients.size())),
                       coefficients.end(), [](double d) { return d == 0; });
  };
  if (!all_zero(0)) {
    const bool rational_named = model == "rational_polynomial";
    if (!rational_named && !model.empty() && model != "plumb_bob")
      throw InputError("its distortion model " + model + " is none of ours (plumb_bob, rational_polynomial)");
    const size_t most = rational_named ? 8 : 5;
    if (coefficients.size() < 4 || !all_zero(most))
      throw InputError(std::to_string(coefficients.size()) + " coefficients of distortion, 4 to " +
                       std::to_string(most) + " expected");
    for (size_t i = 0; i < std::min(most, coefficients.size()); ++i) *fields[i] = coefficients[i];
    if (const auto pixel = made.distorted() ? pixel_without_ray(made) : std::nullopt)
      throw InputError("its coefficients of distortion give no ray at pixel (" +
                       std::to_string(std::lround(pixel->x())) + ", " + std::to_string(std::lround(pixel->y())) +
                       "), as no lens does");
  }
  *this = made;
}

std::optional<CameraModel> builtin_camera(const std::string& name) {
  CameraModel c;
  c.fps = 30;
  if (name == "fr1") {
    c.readout = kKinectReadout;
    c.depth_time_offset = kKinectDepthOffset;
    c.fx = 517.3, c.fy = 516.5, c.cx = 318.6, c.cy = 255.3;
    c.k1 = 0.2624, c.k2 = -0.9531, c.p1 = -0.0054, c.p2 = 0.0026, c.k3 = 1.1633;
  } else if (name == "fr2") {
    c.readout = kKinectReadout;
    c.depth_time_offset = kKinectDepthOffset;
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
