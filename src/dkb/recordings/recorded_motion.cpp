// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_motion.h"

#include <algorithm>
#include <cmath>

#include "dkb/dataset/odometry_track.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {
namespace {

constexpr size_t kMaxSamples = 20'000;

double square(double x) {
  return x * x;
}

double seconds(int64_t from_ns, int64_t to_ns) {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}

Vector6d diagonal_of(const std::array<double, 36>& covariance) {
  Vector6d diagonal;
  for (int i = 0; i < 6; ++i) diagonal[i] = covariance[static_cast<size_t>(7 * i)];
  return diagonal;
}

bool tells(double variance) {
  return std::isfinite(variance) && variance > 0;
}

// Variances along the axes of a frame, along those of another; what they do not tell stays untold.
Eigen::Vector3d turned(const Eigen::Matrix3d& b_from_a, const Eigen::Vector3d& in_a) {
  return b_from_a.cwiseAbs2() * in_a;
}

}  // namespace

bool RecordedMotion::take_stamp(int64_t stamp_ns) {
  constexpr int kMostRefused = 10;
  if (!samples_.empty() && stamp_ns <= samples_.back().stamp_ns) {
    if (++refused_ < kMostRefused) return false;
    while (!samples_.empty() && samples_.back().stamp_ns >= stamp_ns) samples_.pop_back();
  }
  refused_ = 0;
  if (samples_.size() >= kMaxSamples) samples_.pop_front();
  return true;
}

bool RecordedMotion::add(const OdometryMessage& message) {
  const double norm = message.pose.orientation.norm();
  if (!message.pose.position.allFinite() || !(std::abs(norm - 1) < 0.01) || !take_stamp(message.header.stamp_ns))
    return false;
  Sample sample;
  sample.stamp_ns = message.header.stamp_ns;
  sample.pose = {message.pose.orientation.normalized(), message.pose.position};
  sample.pose_variance = diagonal_of(message.pose_covariance);
  sample.twist_variance = diagonal_of(message.twist_covariance);
  samples_.push_back(sample);
  return true;
}

bool RecordedMotion::add(const ImuMessage& message) {
  if (!tells_rates(message) || !message.angular_velocity.allFinite() || !take_stamp(message.header.stamp_ns))
    return false;
  inertial_ = true;
  Sample sample;
  sample.stamp_ns = message.header.stamp_ns;
  sample.rate = message.angular_velocity;
  const std::array<double, 9>& covariance = message.angular_velocity_covariance;
  sample.rate_variance = {covariance[0], covariance[4], covariance[8]};
  samples_.push_back(sample);
  return true;
}

void RecordedMotion::forget_before(int64_t stamp_ns) {
  // One sample before the time is needed to tell what was then.
  while (samples_.size() > 1 && samples_[1].stamp_ns <= stamp_ns) samples_.pop_front();
}

std::optional<MotionPrior> RecordedMotion::between(int64_t from_ns, int64_t to_ns) const {
  if (to_ns <= from_ns) return std::nullopt;
  std::optional<MotionPrior> prior = inertial_ ? by_rates(from_ns, to_ns) : by_poses(from_ns, to_ns);
  if (prior && !is_plausible(*prior)) prior.reset();
  return prior;
}

std::optional<RecordedMotion::Moment> RecordedMotion::at(int64_t stamp_ns) const {
  const auto after = std::lower_bound(samples_.begin(), samples_.end(), stamp_ns,
                                      [](const Sample& s, int64_t t) { return s.stamp_ns < t; });
  if (after == samples_.end()) return std::nullopt;
  if (after->stamp_ns == stamp_ns) return Moment{after->pose, after->pose_variance, after->twist_variance};
  if (after == samples_.begin()) return std::nullopt;
  const Sample& before = *(after - 1);
  const double gap = seconds(before.stamp_ns, after->stamp_ns);
  if (gap > kMaxOdometryGap) return std::nullopt;
  const double share = seconds(before.stamp_ns, stamp_ns) / gap;
  return Moment{interpolated(before.pose, after->pose, share),
                before.pose_variance + share * (after->pose_variance - before.pose_variance), after->twist_variance};
}

std::optional<MotionPrior> RecordedMotion::by_poses(int64_t from_ns, int64_t to_ns) const {
  const std::optional<Moment> from = at(from_ns), to = at(to_ns);
  if (!from || !to) return std::nullopt;
  const Rigid3 motion = from->pose.inverse() * to->pose;
  const double duration = seconds(from_ns, to_ns);
  const double distance = motion.translation.norm(), angle = vector_from_rotation(motion.rotation).norm();
  // The pose's covariance stands in the axes of its world.
  const Eigen::Matrix3d body_from_world = to->pose.matrix3().transpose();
  Vector6d growth = to->pose_variance - from->pose_variance;
  growth << turned(body_from_world, growth.head<3>()), turned(body_from_world, growth.tail<3>());
  Matrix6d covariance = drift_covariance(kUsualDrift, distance, angle);
  for (int i = 0; i < 6; ++i) {
    if (tells(growth[i]))
      covariance(i, i) = growth[i] + square(kMinOdometrySd);
    else if (tells(to->twist_variance[i]))
      covariance(i, i) = to->twist_variance[i] * square(duration) + square(kMinOdometrySd);
    // Directions that a driver does not know carry huge numbers; a metre and a radian a frame are as good as unknown.
    covariance(i, i) = std::min(covariance(i, i), 1.0);
  }
  return in_camera_axes(motion, covariance);
}

std::optional<MotionPrior> RecordedMotion::by_rates(int64_t from_ns, int64_t to_ns) const {
  constexpr double kMaxGap = 0.1, kRateError = 0.01;  // [s], [rad/s]
  if (samples_.size() < 2 || samples_.front().stamp_ns > from_ns || samples_.back().stamp_ns < to_ns)
    return std::nullopt;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d variance = Eigen::Vector3d::Constant(square(kRateError));
  for (size_t i = 1; i < samples_.size() && samples_[i - 1].stamp_ns < to_ns; ++i) {
    const Sample &a = samples_[i - 1], &b = samples_[i];
    if (b.stamp_ns <= from_ns) continue;
    const double gap = seconds(a.stamp_ns, b.stamp_ns);
    if (gap > kMaxGap) return std::nullopt;
    // The rate changes evenly from one message to the next: its mean over the part within the interval.
    const int64_t first = std::max(a.stamp_ns, from_ns), last = std::min(b.stamp_ns, to_ns);
    const double middle = 0.5 * (seconds(a.stamp_ns, first) + seconds(a.stamp_ns, last)) / gap;
    rotation = rotation * rotation_from_vector((a.rate + middle * (b.rate - a.rate)) * seconds(first, last));
    for (int axis = 0; axis < 3; ++axis)
      if (tells(b.rate_variance[axis])) variance[axis] = b.rate_variance[axis];
  }
  Matrix6d covariance = Matrix6d::Identity();
  for (int axis = 0; axis < 3; ++axis)
    covariance(3 + axis, 3 + axis) =
        std::min(variance[axis] * square(seconds(from_ns, to_ns)), 1.0) + square(kMinOdometrySd);
  MotionPrior prior = in_camera_axes({rotation.normalized(), Eigen::Vector3d::Zero()}, covariance);
  prior.rotation_only = true;
  prior.previous_from_current.translation.setZero();
  return prior;
}

MotionPrior RecordedMotion::in_camera_axes(const Rigid3& motion, const Matrix6d& covariance) const {
  const Rigid3 cam_from_body = body_from_cam_.inverse();
  // A small motion on the right of the body's, as one on the right of the camera's.
  return {cam_from_body * motion * body_from_cam_, false, carried(cam_from_body, covariance)};
}

}  // namespace dkb
