// SPDX-License-Identifier: Apache-2.0
/// \file
/// When a frame becomes a keyframe: the interface for rules of one's own.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "dkb_slam/geometry.h"
#include "dkb_slam/version.h"

namespace dkb {

/// A map point that the frame shows.
struct TrackedPoint {
  Eigen::Vector2f pixel;              ///< [px] ideal (undistorted), in the frame
  Eigen::Vector3d position_in_world;  ///< [m]
  int keyframes = 0;                  ///< that see it; 0 = mapping has not worked it in yet
  bool in_last_keyframe = false;      ///< the last keyframe shows it as well
};

/// What a rule may know of a tracked frame.
struct KeyframeQuery {
  int frame = 0;                      ///< index of the frame
  int64_t stamp_ns = 0;               ///< of its colour image
  int frames_since_keyframe = 0;      ///< since the last keyframe
  double seconds_since_keyframe = 0;  ///< [s] likewise
  bool mapper_idle = true;            ///< the last keyframe is in the map
  int tracked_close_points = 0;       ///< points of the pose that are near enough for good depth
  int creatable_close_points = 0;     ///< features near enough that show no map point yet
  int reference_points = 0;           ///< points of the reference keyframe that other keyframes see as well
  Rigid3 world_from_cam;              ///< the frame's pose
  Rigid3 world_from_last_keyframe;    ///< the last keyframe's camera
  std::vector<TrackedPoint> points;   ///< inliers of the pose
};

/// The answer, with the numbers that led to it.
struct KeyframeAnswer {
  bool insert = false;      ///< the frame becomes a keyframe
  std::string explanation;  ///< for logs; may be empty
};

/// Decides whether a tracked frame becomes a keyframe. Called for every tracked frame but a map's first, on the feeding
/// thread. Runs are repeatable as far as the same queries in the same order give the same answers.
class DKB_SLAM_API KeyframePolicy {
 public:
  virtual ~KeyframePolicy() = default;
  /// What it throws leaves Slam::process(), as an InputError, and ends this world until reset() or load_map().
  virtual KeyframeAnswer decide(const KeyframeQuery& query) = 0;
  /// The map starts anew: Slam was made, reset or given a map.
  virtual void reset() {}
};

}  // namespace dkb
