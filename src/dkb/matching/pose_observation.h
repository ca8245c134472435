// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/features/rgbd_features.h"
#include "dkb/matching/optics.h"
#include "dkb/solver/pose_optimiser.h"

namespace dkb {

// A feature that shows the map point at `point_in_world` [m], as the pose solvers want it.
inline PoseObservation pose_observation(const Keypoint& feature, const Eigen::Vector3d& point_in_world,
                                        const Optics& optics) {
  PoseObservation o;
  o.point_in_world = point_in_world;
  o.pixel = feature.pixel.cast<double>();
  o.pixel_sigma = optics.corner_sigma(feature);
  o.depth = feature.depth;
  if (feature.depth > 0) o.depth_sigma = optics.noise.depth_sigma(feature.depth);
  return o;
}

}  // namespace dkb
