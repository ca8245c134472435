// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <numbers>

#include "dkb/geometry/decompositions.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

// What a camera in a hand or on a robot may do while nothing tells of it: standard deviations, in each axis, of its
// accelerations, and of its velocity before the first is known. In all that is what the TUM RGB-D benchmark's hand-held
// walks through a room have on average (fr1/360, desk, desk2, room: 0.35 m/s, 31 degrees/s; Sturm et al., IROS 2012).
inline constexpr double kAccelerationSd = 2.0;         // [m/s^2]
inline constexpr double kAngularAccelerationSd = 6.0;  // [rad/s^2]
inline constexpr double kSpeedSd = 0.2;                // [m/s]
inline constexpr double kAngularSpeedSd = 0.3;         // [rad/s]
inline constexpr double kEvenMotion = 0.2;             // [s] over which its motion is taken to be even

// [m/s] What two velocities of a hand that have nothing to do with each other differ by, in each axis. Turns have no
// such bound: robots turn faster than hands.
inline constexpr double kVelocityChangeSd = std::numbers::sqrt2 * kSpeedSd;
// [m/s] What its velocity may have changed by after some time: an acceleration lasts until the velocity is any other.
inline double velocity_change_sd(double seconds) {
  return std::min(kAccelerationSd * seconds, kVelocityChangeSd);
}
// [m] What that takes the camera off by.
inline double position_change_sd(double seconds) {
  constexpr double kLasts = kVelocityChangeSd / kAccelerationSd;  // [s] the acceleration
  return seconds < kLasts ? 0.5 * kAccelerationSd * seconds * seconds : kVelocityChangeSd * (seconds - 0.5 * kLasts);
}

// [translation, rotation] of the same variance in each axis.
inline Matrix6d axis_covariance(double position_sd, double rotation_sd) {
  Vector6d sd;
  sd << Eigen::Vector3d::Constant(position_sd), Eigen::Vector3d::Constant(rotation_sd);
  return sd.cwiseAbs2().asDiagonal();
}

// The camera's velocity and its covariance: a Kalman filter of steps between poses, whose process noise is an
// acceleration that lasts (Bar-Shalom, Li and Kirubarajan, 2001, section 6.2.2).
class VelocityFilter {
 public:
  VelocityFilter() = default;
  VelocityFilter(const Vector6d& velocity, const Matrix6d& covariance) : velocity_(velocity), covariance_(covariance) {}
  // [m/s, rad/s] tangent of later_cam_from_earlier_cam over one second.
  const Vector6d& velocity() const { return velocity_; }
  // The same `after` seconds without a pose, of which it was told `since` already.
  Matrix6d covariance(double since, double after) const {
    const auto change = [](double t) { return axis_covariance(velocity_change_sd(t), kAngularAccelerationSd * t); };
    return covariance_ + change(after) - change(since);
  }
  // `seconds` pass of which nothing is told.
  void go_on(double seconds) { covariance_ = covariance(0, seconds); }
  // A velocity was measured over `seconds`.
  void update(const Vector6d& measured, const Matrix6d& measured_covariance, double seconds) {
    const Matrix6d predicted = covariance(0, seconds);
    const Matrix6d gain = predicted * inverse(predicted + measured_covariance);
    velocity_ += gain * (measured - velocity_);
    covariance_ = predicted - gain * predicted;
    covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
  }

 private:
  Vector6d velocity_ = Vector6d::Zero();
  Matrix6d covariance_ = axis_covariance(kSpeedSd, kAngularSpeedSd);
};

}  // namespace dkb
