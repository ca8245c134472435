// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>

#include "dkb/recordings/ros_messages.h"
#include "dkb_slam/frame.h"

namespace dkb {

// ROS marks an inertial unit without a gyroscope by a covariance of -1; its rates of 0 are none.
inline bool tells_rates(const ImuMessage& message) {
  return !(message.angular_velocity_covariance[0] < 0);
}

// What wheels or an inertial unit say of the motion between two times. Memory is bounded.
class RecordedMotion {
 public:
  // `body_from_cam`: the camera in the frame that the messages speak of: the odometry's child frame, or the unit's.
  explicit RecordedMotion(const Rigid3& body_from_cam = {}) : body_from_cam_(body_from_cam) {}

  // False: the message is left out, since it is not after the one before, or not finite, or tells no rates. After ten
  // such in a row the clock is taken to have been set back, or one stamp to have been far ahead: it goes on from there.
  // One kind only.
  bool add(const OdometryMessage& message);
  bool add(const ImuMessage& message);
  // Whether what is known reaches up to this time.
  bool reaches(int64_t stamp_ns) const { return !samples_.empty() && samples_.back().stamp_ns >= stamp_ns; }
  void forget_before(int64_t stamp_ns);

  // Odometry: the poses at both times, between those of the messages around them. Its covariance is, in each direction,
  // the growth of the pose's; else, where that tells nothing, the twist's; else that of a drift of 1% of the way, and
  // 0.01 rad for each metre and radian, over ten of them; a floor of 1 mm and 1 mrad is added. Inertial unit: the
  // rotation by the angular rates; their covariance, or 0.01 rad/s where there is none, times the duration, and the
  // same floor. Nothing when messages are missing: farther apart than 0.5 s (odometry) or 0.1 s (inertial unit); and
  // for motions that nothing can make.
  std::optional<MotionPrior> between(int64_t from_ns, int64_t to_ns) const;

 private:
  struct Sample {
    int64_t stamp_ns = 0;
    Rigid3 pose;  // odometry; its variances of x y z and about them, in the axes of its world and of the body
    Vector6d pose_variance = Vector6d::Zero(), twist_variance = Vector6d::Zero();
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();           // [rad/s] inertial unit
    Eigen::Vector3d rate_variance = Eigen::Vector3d::Zero();  // 0 or negative: not known
  };
  struct Moment {
    Rigid3 pose;
    Vector6d pose_variance, twist_variance;
  };
  bool take_stamp(int64_t stamp_ns);
  std::optional<Moment> at(int64_t stamp_ns) const;
  std::optional<MotionPrior> by_poses(int64_t from_ns, int64_t to_ns) const;
  std::optional<MotionPrior> by_rates(int64_t from_ns, int64_t to_ns) const;
  MotionPrior in_camera_axes(const Rigid3& motion, const Matrix6d& covariance) const;

  Rigid3 body_from_cam_;
  bool inertial_ = false;
  std::deque<Sample> samples_;
  int refused_ = 0;  // messages in a row that were not after the one before
};

}  // namespace dkb
