// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "dkb/geometry/rigid3.h"

namespace dkb::sim {

// Pose of a camera over time: t [s] from the start of the sequence -> world_from_cam.
using CameraPath = std::function<Rigid3(double)>;

// Camera at `position` whose optical axis points to `yaw` (from +x towards +y) and `pitch` (up), with the picture's
// right side turned down by `roll`; z of the world is up.
Rigid3 camera_pose(const Eigen::Vector3d& position, double yaw, double pitch, double roll = 0);

// 0 ... 1 with smooth start and end; `ramp` is the share of the time spent on each.
double eased(double s, double ramp);

// Tremor of a hand: smooth, zero on average, about `metres` and `radians` in size, 0.4 ... 4 Hz.
struct Tremor {
  Eigen::Vector3d shift{0, 0, 0};
  double yaw = 0, pitch = 0, roll = 0;
};
Tremor hand_tremor(double t, double metres, double radians, uint64_t seed);
// camera_pose() with such a tremor of 6 mm and 8 mrad, times `strength`.
Rigid3 shaken(const Eigen::Vector3d& position, double yaw, double pitch, double t, double strength, uint64_t seed);

// A path through stamped poses (stamps rising): interpolated, then smoothed by a Gaussian of `sigma` [s], so that
// velocities are steady and the noise of a motion-capture system does not shake the pictures. What comes more than
// `duration` [s] after the first pose is not asked for.
struct TimedPose {
  double time = 0;
  Rigid3 world_from_cam;
};
CameraPath smooth_path(const std::vector<TimedPose>& poses, double sigma,
                       double duration = std::numeric_limits<double>::infinity());

}  // namespace dkb::sim
