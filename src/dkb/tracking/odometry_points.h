// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/matching/candidates.h"
#include "dkb/tracking/frame.h"

namespace dkb {

// Visual-odometry points: features that show no map point are followed from frame to frame until a keyframe makes map
// points of them, so that what has just come into view steadies the pose at once. They never enter the map. Features
// without depth of their own are taken at that of the features around them, which between two frames is near enough to
// tell the camera's rotation.
//
// Deterministic.
class OdometryPoints {
 public:
  OdometryPoints(const CameraModel& camera, double scale_factor, double max_depth)
      : camera_(camera), scale_factor_(scale_factor), max_depth_(max_depth) {}

  // The points as matching wants them, in the world that `frame`, the one last remembered, lives in now. Candidate ids
  // are kNoPoint.
  std::vector<Candidate> candidates(const TrackedFrame& frame) const;
  // Candidate `i` is at the depth of its surroundings.
  bool guessed(size_t i) const { return points_[i].guessed; }
  // Takes the features of `frame`, which has a pose: inliers of points known before keep their place in the world, but
  // for guessed ones; the others start at their depth.
  void remember(const TrackedFrame& frame);
  // Leaves out what has become a map point of `frame`, the one last remembered.
  void drop_mapped(const TrackedFrame& frame);
  void clear() { points_.clear(); }

 private:
  struct Point {
    int feature = -1;              // of the frame last remembered
    Eigen::Vector3d point_in_cam;  // [m] in that frame's camera
    bool guessed = false;          // its depth is that of its surroundings
  };
  static float depth_around(const TrackedFrame& frame, const Keypoint& keypoint);

  CameraModel camera_;
  double scale_factor_, max_depth_;
  std::vector<Point> points_;  // by feature
};

}  // namespace dkb
