// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb_slam/geometry.h"
#include "dkb_slam/image.h"

namespace dkb {

// Depth of a camera of its own, seen from the colour camera.
class DepthRegistration {
 public:
  DepthRegistration(const Camera& depth_camera, const Camera& colour_camera, const Rigid3& colour_from_depth);

  // Each depth pixel goes to where the colour camera sees its point, as a square of the pixel's size there; the nearest
  // one counts. Depth outside of the colour camera's limits becomes 0. `depth` is of the depth camera's size [m].
  DepthImage registered(const DepthImage& depth) const;

 private:
  Camera colour_;
  Rigid3 colour_from_depth_;
  double scale_;                       // [px/px] of equal depth, colour per depth
  std::vector<Eigen::Vector2f> rays_;  // of depth pixels, at depth 1, without distortion
};

}  // namespace dkb
