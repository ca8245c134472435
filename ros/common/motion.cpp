// SPDX-License-Identifier: Apache-2.0
#include "motion.h"

#include <algorithm>
#include <cmath>

namespace dkb_ros {
namespace {

constexpr double kNs = 1e-9;                  // [s]
constexpr int64_t kMaxGap = 500'000'000;      // [ns] between odometry messages that are interpolated over
constexpr int64_t kMaxGyroGap = 100'000'000;  // [ns] the same of angular velocities
constexpr int64_t kMaxAhead = 100'000'000;    // [ns] beyond the newest message
constexpr size_t kMaxMessages = 4000;         // 10 s at 400 Hz
constexpr int kMostRefused = 10;              // messages in a row
// The library reads recordings with the same numbers and a drift of 0.01: src/dkb/dataset/odometry_track.h and
// src/dkb/recordings/recorded_motion.cpp.
constexpr double kMinSd = 1e-3;      // [m, rad] of any motion: wheels slip and shake
constexpr double kDriftLength = 10;  // [m, rad] that the drift is told for
constexpr double kGyroBias = 0.01;   // [rad/s] standard deviation of what a gyroscope shows at rest
constexpr double kUnknown = 1;       // [m^2, rad^2] a larger variance is as good as unknown

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Matrix6d turned(const Eigen::Quaterniond& rotation) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = m.bottomRightCorner<3, 3>() = rotation.toRotationMatrix();
  return m;
}

bool tells(double variance) {
  return std::isfinite(variance) && variance > 0;
}

template <class Message>
auto first_not_before(const std::deque<Message>& messages, int64_t stamp_ns) {
  return std::lower_bound(messages.begin(), messages.end(), stamp_ns,
                          [](const Message& m, int64_t stamp) { return m.stamp_ns < stamp; });
}

// Whether a message of this stamp is taken: after the newest, or, where ten in a row were not, in the place of those
// that are not before it: then one stamp was far ahead, or the clock was set back.
template <class Message>
bool take_stamp(std::deque<Message>* messages, int* refused, int64_t stamp_ns) {
  if (!messages->empty() && stamp_ns <= messages->back().stamp_ns) {
    if (++*refused < kMostRefused) return false;
    while (!messages->empty() && messages->back().stamp_ns >= stamp_ns) messages->pop_back();
  }
  *refused = 0;
  return true;
}

template <class Message>
void keep(std::deque<Message>* messages, const Message& message) {
  messages->push_back(message);
  if (messages->size() > kMaxMessages) messages->pop_front();
}

}  // namespace

Eigen::Quaterniond rotation_by(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle < 1e-12) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, vector / angle));
}

Vector6d twist_of(const Rigid3& motion) {
  const Eigen::AngleAxisd turn(motion.rotation);
  double angle = turn.angle();
  if (angle > M_PI) angle -= 2 * M_PI;
  const Eigen::Vector3d w = angle * turn.axis();
  // The inverse of SO(3)'s left Jacobian.
  const double square = angle * angle;
  const double third = square < 1e-8 ? 1.0 / 12 : (1 - 0.5 * angle / std::tan(0.5 * angle)) / square;
  const Eigen::Matrix3d wx = skew(w);
  Vector6d twist;
  twist << motion.translation - 0.5 * wx * motion.translation + third * wx * wx * motion.translation, w;
  return twist;
}

Matrix6d adjoint(const Rigid3& a_from_b) {
  Matrix6d m = turned(a_from_b.rotation);
  m.topRightCorner<3, 3>() = skew(a_from_b.translation) * a_from_b.matrix3();
  return m;
}

Matrix6d ros_covariance(const Matrix6d& in_camera, const Rigid3& base_from_cam,
                        const Eigen::Quaterniond& parent_from_base) {
  const Matrix6d j = turned(parent_from_base) * adjoint(base_from_cam);
  return j * in_camera * j.transpose();
}

Matrix6d camera_covariance(const Matrix6d& ros, const Rigid3& base_from_cam,
                           const Eigen::Quaterniond& parent_from_base) {
  const Matrix6d j = adjoint(base_from_cam.inverse()) * turned(parent_from_base.conjugate());
  return j * ros * j.transpose();
}

bool OdometryHistory::add(const OdometryMessage& message) {
  const bool finite = message.pose.translation.allFinite() && message.pose.rotation.coeffs().allFinite() &&
                      std::abs(message.pose.rotation.norm() - 1) < 0.01 && message.twist.allFinite();
  if (!finite || !take_stamp(&messages_, &refused_, message.stamp_ns)) return false;
  keep(&messages_, message);
  messages_.back().pose.rotation.normalize();
  return true;
}

std::optional<OdometryHistory::Moment> OdometryHistory::at(int64_t stamp_ns) const {
  const auto after = first_not_before(messages_, stamp_ns);
  if (after == messages_.end()) {
    if (empty() || stamp_ns - messages_.back().stamp_ns > kMaxAhead) return std::nullopt;
    const OdometryMessage& last = messages_.back();
    const double dt = kNs * static_cast<double>(stamp_ns - last.stamp_ns);
    return Moment{last.pose * Rigid3(rotation_by(dt * last.twist.tail<3>()), dt * last.twist.head<3>()),
                  Vector6d::Zero()};
  }
  if (after->stamp_ns == stamp_ns) return Moment{after->pose, after->pose_covariance.diagonal()};
  if (after == messages_.begin()) return std::nullopt;
  const OdometryMessage &a = *(after - 1), &b = *after;
  if (b.stamp_ns - a.stamp_ns > kMaxGap) return std::nullopt;
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  const Vector6d first = a.pose_covariance.diagonal(), second = b.pose_covariance.diagonal();
  return Moment{{a.pose.rotation.slerp(share, b.pose.rotation),
                 a.pose.translation + share * (b.pose.translation - a.pose.translation)},
                first + share * (second - first)};
}

std::optional<dkb::MotionPrior> OdometryHistory::between(int64_t from_ns, int64_t to_ns) const {
  const std::optional<Moment> from = at(from_ns), to = at(to_ns);
  if (!from || !to) return std::nullopt;
  dkb::MotionPrior prior;
  prior.previous_from_current = from->pose.inverse() * to->pose;
  const auto nearest = first_not_before(messages_, to_ns);
  const bool ahead = nearest == messages_.end();  // how the pose's covariance grew until then is not told
  const OdometryMessage& message = ahead ? messages_.back() : *nearest;
  const double dt = kNs * static_cast<double>(to_ns - from_ns);
  const double distance = prior.previous_from_current.translation.norm();
  const double angle = Eigen::Quaterniond::Identity().angularDistance(prior.previous_from_current.rotation);
  const Eigen::Matrix3d child_from_parent = to->pose.matrix3().transpose();
  Vector6d growth = to->variance - from->variance;
  growth << child_from_parent.cwiseAbs2() * growth.head<3>(), child_from_parent.cwiseAbs2() * growth.tail<3>();
  prior.covariance.setZero();
  for (int i = 0; i < 6; ++i) {
    double variance = drift_ * drift_ * kDriftLength * (i < 3 ? distance : distance + angle);
    if (!ahead && tells(growth(i)))
      variance = growth(i);
    else if (tells(message.twist_covariance(i, i)))
      variance = dt * dt * message.twist_covariance(i, i);
    prior.covariance(i, i) = std::min(variance + kMinSd * kMinSd, kUnknown);
  }
  return prior;
}

bool GyroHistory::add(const ImuMessage& message) {
  // -1: ROS' mark of an imu without a gyroscope.
  const bool usable = message.angular_velocity.allFinite() && !(message.covariance(0, 0) < 0);
  if (!usable || !take_stamp(&messages_, &refused_, message.stamp_ns)) return false;
  keep(&messages_, message);
  return true;
}

std::optional<dkb::MotionPrior> GyroHistory::between(int64_t from_ns, int64_t to_ns) const {
  if (empty() || to_ns <= from_ns) return std::nullopt;
  auto sample = first_not_before(messages_, from_ns);
  if (sample == messages_.begin() && sample->stamp_ns > from_ns) return std::nullopt;
  // From the last sample before `from` on. The newest one holds.
  if (sample == messages_.end() || sample->stamp_ns > from_ns) --sample;
  dkb::MotionPrior prior;
  prior.rotation_only = true;
  Eigen::Vector3d variance = Eigen::Vector3d::Constant(kGyroBias * kGyroBias);
  for (int64_t at = from_ns; at < to_ns; ++sample) {
    const auto next = sample + 1;
    const int64_t until = next == messages_.end() ? to_ns : std::min(next->stamp_ns, to_ns);
    if (until - sample->stamp_ns > kMaxGyroGap) return std::nullopt;
    const double dt = kNs * static_cast<double>(until - at);
    Eigen::Vector3d rate = sample->angular_velocity;
    if (next != messages_.end()) {  // its mean over the part within the interval
      const double middle = 0.5 * static_cast<double>((at - sample->stamp_ns) + (until - sample->stamp_ns)) /
                            static_cast<double>(next->stamp_ns - sample->stamp_ns);
      rate += middle * (next->angular_velocity - sample->angular_velocity);
    }
    prior.previous_from_current.rotation = (prior.previous_from_current.rotation * rotation_by(dt * rate)).normalized();
    for (int axis = 0; axis < 3; ++axis)
      if (tells(sample->covariance(axis, axis))) variance(axis) = sample->covariance(axis, axis);
    at = until;
  }
  const double duration = kNs * static_cast<double>(to_ns - from_ns);
  prior.covariance.setIdentity();
  for (int axis = 0; axis < 3; ++axis)
    prior.covariance(3 + axis, 3 + axis) = std::min(duration * duration * variance(axis) + kMinSd * kMinSd, kUnknown);
  return prior;
}

dkb::MotionPrior moved_to_camera(const dkb::MotionPrior& prior, const Rigid3& cam_from_frame) {
  dkb::MotionPrior moved = prior;
  if (prior.rotation_only) {
    const Eigen::Quaterniond& q = cam_from_frame.rotation;
    moved.previous_from_current = Rigid3(q * prior.previous_from_current.rotation * q.conjugate(), {0, 0, 0});
    const Matrix6d j = turned(q);
    moved.covariance = j * prior.covariance * j.transpose();
    return moved;
  }
  moved.previous_from_current = cam_from_frame * prior.previous_from_current * cam_from_frame.inverse();
  const Matrix6d j = adjoint(cam_from_frame);
  moved.covariance = j * prior.covariance * j.transpose();
  return moved;
}

}  // namespace dkb_ros
