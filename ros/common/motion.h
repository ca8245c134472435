// SPDX-License-Identifier: Apache-2.0
// Motions and their covariances in ROS' terms, and motion priors from wheel odometry and gyroscopes.
#pragma once

#include <dkb_slam/frame.h>

#include <deque>
#include <optional>

#include "types.h"

namespace dkb_ros {

// The twist [v, w] that is this motion after one second, in the axes of the moving frame.
Vector6d twist_of(const Rigid3& motion);
// A rotation by a vector [rad].
Eigen::Quaterniond rotation_by(const Eigen::Vector3d& vector);
// Maps right perturbations [translation, rotation] in frame b to the same in frame a.
Matrix6d adjoint(const Rigid3& a_from_b);
// The library's covariance, a right perturbation in camera axes, as that of the base's pose in ROS' order: position and
// rotation about the fixed axes of the parent frame.
Matrix6d ros_covariance(const Matrix6d& in_camera, const Rigid3& base_from_cam,
                        const Eigen::Quaterniond& parent_from_base);
// The reverse, for /initialpose.
Matrix6d camera_covariance(const Matrix6d& ros, const Rigid3& base_from_cam,
                           const Eigen::Quaterniond& parent_from_base);

// Poses of wheel odometry; answers with the motion between two times.
class OdometryHistory {
 public:
  // `drift`: the share that ten metres, or ten radians, are off by where the messages give no covariance. A shorter
  // motion is off by more: its standard deviation grows with the root of it.
  explicit OdometryHistory(double drift) : drift_(drift) {}

  // False when its stamp does not rise or a number is not finite; it is left out then. After ten stamps in a row that
  // do not rise the clock is taken to have been set back, or one stamp to have been far ahead: it goes on from there.
  bool add(const OdometryMessage& message);
  void clear() { messages_.clear(), refused_ = 0; }
  bool empty() const { return messages_.empty(); }
  const std::string& child_frame_id() const { return messages_.back().child_frame_id; }

  // The motion of the child frame; its covariance is that of a right perturbation in the child frame's axes: in each
  // direction the growth of the pose's; else, where that tells nothing, the twist's; else that of the drift; and 1 mm
  // and 1 mrad. So it is in recordings, too, with a drift of 0.01. Poses are interpolated, and carried on by the twist
  // for at most 0.1 s after the newest. Nothing where messages are missing.
  std::optional<dkb::MotionPrior> between(int64_t from_ns, int64_t to_ns) const;

 private:
  struct Moment {
    Rigid3 pose;
    Vector6d variance = Vector6d::Zero();  // of the pose, in the axes of the frame that stands still
  };
  std::optional<Moment> at(int64_t stamp_ns) const;

  double drift_;
  std::deque<OdometryMessage> messages_;  // by stamp
  int refused_ = 0;                       // stamps in a row that did not rise
};

// Angular velocities; answers with the rotation between two times.
class GyroHistory {
 public:
  bool add(const ImuMessage& message);  // as above
  void clear() { messages_.clear(), refused_ = 0; }
  bool empty() const { return messages_.empty(); }
  const std::string& frame_id() const { return messages_.back().frame_id; }

  // The rotation of the sensor's frame, by rates that change evenly from sample to sample; their covariance, or
  // 0.01 rad/s where there is none, times the duration, and 1 mrad. Nothing where samples are more than 0.1 s apart.
  std::optional<dkb::MotionPrior> between(int64_t from_ns, int64_t to_ns) const;

 private:
  std::deque<ImuMessage> messages_;  // by stamp
  int refused_ = 0;                  // as above
};

// A prior of another frame that is fixed to the camera, as the camera's.
dkb::MotionPrior moved_to_camera(const dkb::MotionPrior& prior, const Rigid3& cam_from_frame);

}  // namespace dkb_ros
