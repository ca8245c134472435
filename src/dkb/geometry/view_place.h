// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace dkb {

// Where something lies in a view, so that what is near each other hangs together: across the image in tenths of its
// width, in depth by the ratio of depths, of which 0.2 is as far.
inline Eigen::Vector3d place_in_view(const Eigen::Vector2d& pixel, double depth, double image_width) {
  constexpr double kWidth = 0.1, kDepthRatio = 0.2;
  const Eigen::Vector2d at = pixel / (kWidth * image_width);
  return {at.x(), at.y(), std::log(depth) / kDepthRatio};
}

}  // namespace dkb
