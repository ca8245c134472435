// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/depth_registration.h"

#include <algorithm>
#include <cmath>

#include "dkb/geometry/camera.h"
#include "dkb/image/image.h"

namespace dkb {

DepthRegistration::DepthRegistration(const Camera& depth_camera, const Camera& colour_camera,
                                     const Rigid3& colour_from_depth)
    : colour_(colour_camera),
      colour_from_depth_(colour_from_depth),
      scale_(std::max(colour_camera.fx / depth_camera.fx, colour_camera.fy / depth_camera.fy)) {
  rays_.reserve(static_cast<size_t>(depth_camera.width) * static_cast<size_t>(depth_camera.height));
  for (int y = 0; y < depth_camera.height; ++y)
    for (int x = 0; x < depth_camera.width; ++x) {
      const Eigen::Vector2d ideal = depth_camera.undistort({x, y});
      rays_.push_back(depth_camera.unproject(ideal, 1).head<2>().cast<float>());
    }
}

DepthImage DepthRegistration::registered(const DepthImage& depth) const {
  // Wider than the pixel's size, so that rounding leaves no gaps on slanted surfaces; narrower than two pixels where
  // both cameras see equally fine.
  constexpr double kMargin = 0.1, kMaxReach = 8;         // [px]
  const auto near = [&](const Eigen::Vector2d& pixel) {  // false for what is no number
    return pixel.x() > -colour_.width && pixel.x() < 2 * colour_.width && pixel.y() > -colour_.height &&
           pixel.y() < 2 * colour_.height;
  };
  DepthImage out(colour_.width, colour_.height);
  const Eigen::Matrix3d rotation = colour_from_depth_.matrix3();
  for (size_t i = 0; i < depth.size(); ++i) {
    const double z = depth.data()[i];
    if (!(z > 0) || !std::isfinite(z)) continue;
    const Eigen::Vector3d seen(z * rays_[i].x(), z * rays_[i].y(), z);
    const Eigen::Vector3d point = rotation * seen + colour_from_depth_.translation;
    const auto pixel = image_pixel(colour_, point);
    if (!pixel || !near(*pixel)) continue;
    const double reach = std::min(0.5 * scale_ * z / point.z() + kMargin, kMaxReach);
    const auto metres = static_cast<float>(point.z());
    const int left = std::max(0, static_cast<int>(std::ceil(pixel->x() - reach)));
    const int right = std::min(colour_.width - 1, static_cast<int>(std::floor(pixel->x() + reach)));
    const int top = std::max(0, static_cast<int>(std::ceil(pixel->y() - reach)));
    const int bottom = std::min(colour_.height - 1, static_cast<int>(std::floor(pixel->y() + reach)));
    for (int y = top; y <= bottom; ++y)
      for (int x = left; x <= right; ++x) {
        float& there = out(x, y);
        if (there == 0 || metres < there) there = metres;
      }
  }
  depth_from_metres(out.data(), out.size(), colour_, out.data());
  return out;
}

}  // namespace dkb
