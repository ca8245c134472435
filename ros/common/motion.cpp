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
constexpr double kMinSd = 1e-4;               // [m, rad] no sensor is better between two images
constexpr double kGyroBias = 0.005;           // [rad/s] standard deviation of what a gyroscope shows at rest

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

Matrix6d with_floor(Matrix6d covariance) {
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  covariance.diagonal().array() += kMinSd * kMinSd;
  return covariance;
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
                      std::abs(message.pose.rotation.norm() - 1) < 0.01 && message.twist.allFinite() &&
                      message.twist_covariance.allFinite();
  if (!finite || !take_stamp(&messages_, &refused_, message.stamp_ns)) return false;
  keep(&messages_, message);
  messages_.back().pose.rotation.normalize();
  return true;
}

std::optional<Rigid3> OdometryHistory::pose_at(int64_t stamp_ns) const {
  const auto after = first_not_before(messages_, stamp_ns);
  if (after == messages_.end()) {
    if (empty() || stamp_ns - messages_.back().stamp_ns > kMaxAhead) return std::nullopt;
    const OdometryMessage& last = messages_.back();
    const double dt = kNs * static_cast<double>(stamp_ns - last.stamp_ns);
    return last.pose * Rigid3(rotation_by(dt * last.twist.tail<3>()), dt * last.twist.head<3>());
  }
  if (after->stamp_ns == stamp_ns) return after->pose;
  if (after == messages_.begin()) return std::nullopt;
  const OdometryMessage &a = *(after - 1), &b = *after;
  if (b.stamp_ns - a.stamp_ns > kMaxGap) return std::nullopt;
  const double share = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  return Rigid3(a.pose.rotation.slerp(share, b.pose.rotation),
                a.pose.translation + share * (b.pose.translation - a.pose.translation));
}

std::optional<dkb::MotionPrior> OdometryHistory::between(int64_t from_ns, int64_t to_ns) const {
  const std::optional<Rigid3> from = pose_at(from_ns), to = pose_at(to_ns);
  if (!from || !to) return std::nullopt;
  dkb::MotionPrior prior;
  prior.previous_from_current = from->inverse() * *to;
  const auto nearest = first_not_before(messages_, to_ns);
  const OdometryMessage& message = nearest == messages_.end() ? messages_.back() : *nearest;
  const double dt = kNs * static_cast<double>(to_ns - from_ns);
  if (message.twist_covariance.isZero()) {
    const double way = prior.previous_from_current.translation.norm();
    const double turn = Eigen::Quaterniond::Identity().angularDistance(prior.previous_from_current.rotation);
    const double sd_m = drift_ * way + 1e-3, sd_rad = drift_ * (turn + way) + 1e-3;
    prior.covariance.setZero();
    prior.covariance.diagonal().head<3>().setConstant(sd_m * sd_m);
    prior.covariance.diagonal().tail<3>().setConstant(sd_rad * sd_rad);
  } else {
    prior.covariance = dt * dt * message.twist_covariance;
  }
  prior.covariance = with_floor(prior.covariance);
  return prior;
}

bool GyroHistory::add(const ImuMessage& message) {
  const bool usable = message.angular_velocity.allFinite() && message.covariance.allFinite() &&
                      message.covariance(0, 0) >= 0;  // -1: ROS' mark of an imu without a gyroscope
  if (!usable || !take_stamp(&messages_, &refused_, message.stamp_ns)) return false;
  keep(&messages_, message);
  return true;
}

std::optional<dkb::MotionPrior> GyroHistory::between(int64_t from_ns, int64_t to_ns) const {
  if (empty() || to_ns <= from_ns) return std::nullopt;
  auto sample = first_not_before(messages_, from_ns);
  if (sample == messages_.begin() && sample->stamp_ns > from_ns) return std::nullopt;
  // Each sample holds until the next one; the first is the last before `from`.
  if (sample == messages_.end() || sample->stamp_ns > from_ns) --sample;
  dkb::MotionPrior prior;
  prior.rotation_only = true;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (int64_t at = from_ns; at < to_ns; ++sample) {
    const auto next = sample + 1;
    const int64_t until = next == messages_.end() ? to_ns : std::min(next->stamp_ns, to_ns);
    if (until - sample->stamp_ns > kMaxGyroGap) return std::nullopt;
    const double dt = kNs * static_cast<double>(until - at);
    prior.previous_from_current.rotation =
        (prior.previous_from_current.rotation * rotation_by(dt * sample->angular_velocity)).normalized();
    covariance += dt * dt * sample->covariance;
    at = until;
  }
  const double bias = kGyroBias * kNs * static_cast<double>(to_ns - from_ns);
  covariance.diagonal().array() += bias * bias;
  prior.covariance.setIdentity();
  prior.covariance.bottomRightCorner<3, 3>() = covariance;
  prior.covariance = with_floor(prior.covariance);
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
