// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/matching/candidates.h"
#include "dkb/matching/optics.h"
#include "dkb/tracking/frame.h"

namespace dkb {

// Visual-odometry points: features that show no map point are followed from frame to frame until a keyframe makes map
// points of them, so that what has just come into view steadies the pose at once. They never enter the map. Features
// without depth of their own are taken at that of the features around them, and at the reach of depth where these have
// none either: between two frames that is near enough to tell the camera's rotation, which of all that is seen what is
// far tells best. As long as they are followed they must stay on the ray of their first sighting, whatever
// their depth: what leaves it moves (the epipolar constraint; Hartley and Zisserman, 2004, section 9.1).
//
// Deterministic.
class OdometryPoints {
 public:
  // `reach` [m]: points whose depth is farther are not followed.
  OdometryPoints(const Optics& optics, double reach) : optics_(optics), reach_(static_cast<float>(reach)) {}

  // The points as matching wants them, in the world that `frame`, the one last remembered, lives in now. Candidate ids
  // are kNoPoint.
  std::vector<Candidate> candidates(const PosedFrame& frame) const;
  // Candidate `i`, shown by a feature of the frame after.
  OdometryMatch match(size_t i, const PosedFrame& frame) const;
  // [px] standard deviation of where a guessed point lies in an image, since its depth is one: from the last frame's
  // pose, in which the guess was made, to that of the image. It may as well be twice as near or far away; an inverse
  // depth that is even from 0 to twice the guess has a standard deviation of the guess over sqrt(3).
  double parallax_sigma(const OdometryMatch& guessed, const Rigid3& last_cam_from_world,
                        const Rigid3& cam_from_world) const;
  // Whether a guessed point has moved when `keypoint` shows it from a pose of that covariance (as TrackedFrame has it):
  // no place on the ray of its first sighting is seen there. `limit` is that of the squared distance over its variance.
  bool has_moved(const OdometryMatch& match, const Keypoint& keypoint, const Rigid3& cam_from_world,
                 const Matrix6d& covariance, double limit) const;
  // Takes the features of `frame`, which has a pose: inliers of points known before keep their place in the world, but
  // for guessed ones; the others start at their depth.
  void remember(const TrackedFrame& frame);
  // Leaves out what has become a map point of `frame`, the one last remembered.
  void drop_mapped(const PosedFrame& frame);
  void clear() { points_.clear(); }

 private:
  struct Point {
    int feature = -1;              // of the frame last remembered
    Eigen::Vector3d point_in_cam;  // [m] in that frame's camera
    bool guessed = false;          // its depth is that of its surroundings
    SightRay first_in_cam;         // of guessed ones, in that frame's camera
    bool moves = false;            // it has left that ray
  };
  double sight_variance(const Keypoint& keypoint, const Eigen::Vector3d& point_in_cam,
                        const Matrix6d& covariance) const;
  float depth_around(const TrackedFrame& frame, const Keypoint& keypoint) const;

  Optics optics_;
  float reach_;
  std::vector<Point> points_;  // by feature
};

}  // namespace dkb
