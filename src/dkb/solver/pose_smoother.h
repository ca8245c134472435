// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "dkb/geometry/rigid3.h"

namespace dkb {

// A pose as measured in one frame.
struct MeasuredPose {
  double time = 0;  // [s]
  Rigid3 world_from_cam;
  Matrix6d covariance;  // right perturbation, [translation m, rotation rad], camera axes
};

// What is uncertain about how a camera moves and is measured.
struct MotionNoise {
  double acceleration = 0.1;  // [m^2/s^3] spectral density of its acceleration, each axis
  double angular = 0.3;       // [rad^2/s^3] of its angular acceleration
  double measurement = 4;     // on the covariances of the measured poses: errors of one frame's features go together
};

// Poses of one camera in one world, by rising time, each made more exact by all the others: whatever carries the camera
// has mass. Acceleration is white noise (Barfoot, Tong, Sarkka 2014, "Batch Continuous-Time Trajectory Estimation as
// Exactly Sparse Gaussian Process Regression"), poses are combined by a Kalman filter and a pass backwards (Rauch,
// Tung, Striebel 1965), and the noise is what makes the measured poses most likely (expectation maximisation: Shumway,
// Stoffer 1982), starting from `start`; one pass leaves that as it is, and after six there is little to gain. Some 0.1
// ms a pose.
std::vector<Rigid3> smoothed_poses(std::span<const MeasuredPose> measured, MotionNoise start = {}, int passes = 6);

}  // namespace dkb
