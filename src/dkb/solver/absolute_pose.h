// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/solver/pose_optimiser.h"

namespace dkb {

struct RansacOptions {
  int min_inliers = 10;  // fewer: not ok, >= 3
  uint64_t seed = 1;

  void check() const;  // throws InvalidOption
};

struct RansacPose {
  bool ok = false;
  Rigid3 pose;                  // cam_from_world; identity where not ok
  std::vector<uint8_t> inlier;  // per correspondence
  int inliers = 0;
  int iterations = 0;
};

// Poses of a calibrated camera from three points (perspective-3-point; source in p3p.cpp): up to 4, in front of it.
// `rays` are unit vectors in the camera. Nothing for degenerate input (collinear points).
std::vector<Rigid3> solve_p3p(const Eigen::Vector3d (&points_in_world)[3], const Eigen::Vector3d (&rays)[3]);

// cam_from_world from 2D-3D matches with outliers (relocalisation): RANSAC over P3P, then optimise_pose on the inliers
// of the best sample, whose inliers are those returned. Depths of the observations take part in that refinement and in
// the choice of inliers. Deterministic for a seed.
RansacPose estimate_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> observations,
                                  const RansacOptions& options = {});

}  // namespace dkb
