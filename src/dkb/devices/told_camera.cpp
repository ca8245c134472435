// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/told_camera.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr double kMostError = 0.5;  // [px] of a fitted lens
constexpr int kColumns = 33, kRows = 25;

ToldCamera untold(Camera camera, const std::string& reason) {
  camera.fx = 0;
  return {camera, reason};
}

}  // namespace

double fit_inverse_lens(Camera* camera) {
  const Camera inverse = *camera;
  struct Ray {
    Eigen::Vector2d ideal, image;  // [px]
  };
  std::vector<Ray> rays;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const Eigen::Vector2d image(column * (inverse.width - 1.0) / (kColumns - 1),
                                  row * (inverse.height - 1.0) / (kRows - 1));
      rays.push_back({inverse.distort(image), image});  // the same polynomial, the other way round
    }
  // The distorting model is linear in its coefficients k1, k2, k3, p1, p2.
  const auto count = static_cast<Eigen::Index>(rays.size());
  Eigen::MatrixXd factors(2 * count, 5);
  Eigen::VectorXd offsets(2 * count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Ray& ray = rays[static_cast<size_t>(i)];
    const Eigen::Vector3d ideal = inverse.unproject(ray.ideal, 1), image = inverse.unproject(ray.image, 1);
    const double x = ideal.x(), y = ideal.y(), r2 = x * x + y * y;
    factors.row(2 * i) << x * r2, x * r2 * r2, x * r2 * r2 * r2, 2 * x * y, r2 + 2 * x * x;
    factors.row(2 * i + 1) << y * r2, y * r2 * r2, y * r2 * r2 * r2, r2 + 2 * y * y, 2 * x * y;
    offsets.segment<2>(2 * i) = (image - ideal).head<2>();
  }
  const Eigen::VectorXd fitted = factors.colPivHouseholderQr().solve(offsets);
  camera->k1 = fitted[0], camera->k2 = fitted[1], camera->k3 = fitted[2];
  camera->p1 = fitted[3], camera->p2 = fitted[4];
  double largest = 0;
  for (const Ray& ray : rays) {
    const double error = (camera->distort(ray.ideal) - ray.image).norm();
    if (!std::isfinite(error)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, error);
  }
  return largest;
}

ToldCamera told_camera(const DkbDeviceCamera& told) {
  Camera camera;
  camera.width = told.width, camera.height = told.height, camera.fps = told.fps;
  camera.fx = told.fx, camera.fy = told.fy, camera.cx = told.cx, camera.cy = told.cy;
  camera.depth_factor = told.depth_factor;
  if (!(told.fx > 0)) return untold(camera, "does not tell its camera");
  if (told.lens == dkb_lens_other)
    return untold(camera, "its lens is told by a model that is none of ours (Brown-Conrady, its inverse, rational)");
  if (told.lens == dkb_lens_inverse) {
    camera.k1 = told.k1, camera.k2 = told.k2, camera.p1 = told.p1, camera.p2 = told.p2, camera.k3 = told.k3;
    if (!camera.distorted()) return {camera, ""};
    const double error = fit_inverse_lens(&camera);
    if (!(error <= kMostError))
      return untold(camera, "its lens, told by the inverse Brown-Conrady model, is met by ours only within " +
                                std::to_string(error) + " px");
    return {camera, ""};
  }
  try {
    const bool rational = told.k4 != 0 || told.k5 != 0 || told.k6 != 0;
    std::vector<double> coefficients{told.k1, told.k2, told.p1, told.p2, told.k3};
    if (rational) coefficients.insert(coefficients.end(), {told.k4, told.k5, told.k6});
    camera.set_distortion(rational ? "rational_polynomial" : "plumb_bob", coefficients);
  } catch (const InputError& e) {
    return untold(camera, e.what());
  }
  return {camera, ""};
}

}  // namespace dkb
