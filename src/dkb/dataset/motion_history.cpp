// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <limits>

#include "dkb/dataset/odometry_track.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/given_motion.h"
#include "dkb/util/errors.h"
#include "dkb_slam/source.h"

namespace dkb {
namespace {

constexpr size_t kMostSamples = 20'000;
constexpr int kMostRefused = 10;     // samples in a row
constexpr double kMaxAhead = 0.1;    // [s] beyond the newest sample
constexpr double kMaxRateGap = 0.1;  // [s] between rates that are interpolated over
constexpr double kRateSd = 0.01;     // [rad/s] of what a gyroscope shows at rest
constexpr double kUnknown = 1;       // [m^2, rad^2] a larger variance is as good as unknown
constexpr double kPoseNorm = 0.01;   // that quaternions in messages are off by

using Samples = std::deque<OdometrySample>;

double square(double x) {
  return x * x;
}

bool tells(double variance) {
  return std::isfinite(variance) && variance > 0;
}

// [s] To a time that is not before the other one, and may be any.
double seconds(int64_t from_ns, int64_t to_ns) {
  return 1e-9 * static_cast<double>(static_cast<uint64_t>(to_ns) - static_cast<uint64_t>(from_ns));
}

// The first sample after a time.
Samples::const_iterator first_after(const Samples& samples, int64_t stamp_ns) {
  return std::upper_bound(samples.begin(), samples.end(), stamp_ns,
                          [](int64_t stamp, const OdometrySample& s) { return stamp < s.stamp_ns; });
}

// What is told of one time; nothing where samples are missing.
std::optional<OdometrySample> sample_at(const Samples& samples, int64_t stamp_ns) {
  const auto after = first_after(samples, stamp_ns);
  if (after == samples.begin()) return std::nullopt;
  const OdometrySample& a = *std::prev(after);
  if (a.stamp_ns == stamp_ns) return a;
  const double since = seconds(a.stamp_ns, stamp_ns);
  if (after == samples.end()) {
    if (since > kMaxAhead || !a.twist.allFinite()) return std::nullopt;
    OdometrySample ahead = a;
    ahead.pose = a.pose * Rigid3(rotation_from_vector(since * a.twist.tail<3>()), since * a.twist.head<3>());
    ahead.pose_variance.setConstant(std::numeric_limits<double>::quiet_NaN());  // how it grew is not told
    return ahead;
  }
  const double gap = seconds(a.stamp_ns, after->stamp_ns);
  if (gap > kMaxOdometryGap) return std::nullopt;
  OdometrySample made = *after;
  made.pose = interpolated(a.pose, after->pose, since / gap);
  made.pose_variance = a.pose_variance + since / gap * (after->pose_variance - a.pose_variance);
  return made;
}

std::optional<MotionPrior> by_poses(const Samples& samples, double drift, int64_t from_ns, int64_t to_ns) {
  const std::optional<OdometrySample> from = sample_at(samples, from_ns), to = sample_at(samples, to_ns);
  if (!from || !to) return std::nullopt;
  MotionPrior prior;
  const Rigid3& motion = prior.previous_from_current = from->pose.inverse() * to->pose;
  prior.covariance = drift_covariance(drift, motion.translation.norm(), vector_from_rotation(motion.rotation).norm());
  // The pose's variance stands in the axes of the frame that stands still.
  const Eigen::Matrix3d to_body = to->pose.matrix3().transpose().cwiseAbs2();
  const Vector6d difference = to->pose_variance - from->pose_variance;
  Vector6d growth;
  growth << to_body * difference.head<3>(), to_body * difference.tail<3>();
  for (int i = 0; i < 6; ++i) {
    double& variance = prior.covariance(i, i);
    if (tells(growth[i]))
      variance = growth[i] + square(kMinOdometrySd);
    else if (tells(to->twist_variance[i]))
      variance = to->twist_variance[i] * square(seconds(from_ns, to_ns)) + square(kMinOdometrySd);
    variance = std::min(variance, kUnknown);
  }
  return prior;
}

std::optional<MotionPrior> by_rates(const Samples& samples, int64_t from_ns, int64_t to_ns) {
  auto sample = first_after(samples, from_ns);
  if (sample == samples.begin()) return std::nullopt;
  --sample;
  MotionPrior prior;
  prior.rotation_only = true;
  Eigen::Quaterniond& rotation = prior.previous_from_current.rotation;
  Eigen::Vector3d variance = Eigen::Vector3d::Constant(square(kRateSd));
  for (int64_t begin = from_ns; begin < to_ns; ++sample) {
    const auto next = std::next(sample);
    const bool newest = next == samples.end();
    const int64_t end = newest ? to_ns : std::min(next->stamp_ns, to_ns);
    const double gap = seconds(sample->stamp_ns, newest ? to_ns : next->stamp_ns);
    if (gap > kMaxRateGap) return std::nullopt;
    Eigen::Vector3d rate = sample->twist.tail<3>();
    if (!newest) {  // its mean over the part within the interval
      const double middle = 0.5 * (seconds(sample->stamp_ns, begin) + seconds(sample->stamp_ns, end)) / gap;
      rate += middle * (next->twist.tail<3>() - rate);
    }
    rotation = (rotation * rotation_from_vector(seconds(begin, end) * rate)).normalized();
    for (int axis = 0; axis < 3; ++axis)
      if (tells(sample->twist_variance[3 + axis])) variance[axis] = sample->twist_variance[3 + axis];
    begin = end;
  }
  for (int axis = 0; axis < 3; ++axis)
    prior.covariance(3 + axis, 3 + axis) =
        std::min(variance[axis] * square(seconds(from_ns, to_ns)) + square(kMinOdometrySd), kUnknown);
  return prior;
}

}  // namespace

MotionHistory::MotionHistory(double drift) : drift_(drift) {
  require_option(drift >= 0 && drift <= 1, "drift", drift, "0 ... 1");
}

bool MotionHistory::add(const OdometrySample& sample) {
  if (!is_rigid(sample.pose, kPoseNorm) || !take(sample, false)) return false;
  OdometrySample& taken = samples_.back();
  taken.pose.rotation.normalize();
  if (!taken.twist.allFinite()) taken.twist_variance.setZero();
  return true;
}

bool MotionHistory::add(const GyroSample& sample) {
  if (!sample.rate.allFinite() || sample.rate_variance.x() < 0) return false;
  OdometrySample kept;
  kept.stamp_ns = sample.stamp_ns;
  kept.twist.tail<3>() = sample.rate, kept.twist_variance.tail<3>() = sample.rate_variance;
  return take(kept, true);
}

bool MotionHistory::take(const OdometrySample& sample, bool rates) {
  if (!samples_.empty() && rates != rates_) return false;
  if (reaches(sample.stamp_ns)) {
    if (++refused_ < kMostRefused) return false;
    while (reaches(sample.stamp_ns)) samples_.pop_back();
  }
  refused_ = 0, rates_ = rates;
  samples_.push_back(sample);
  if (samples_.size() > kMostSamples) samples_.pop_front();
  return true;
}

void MotionHistory::clear() {
  samples_.clear(), refused_ = 0;
}

void MotionHistory::forget_before(int64_t stamp_ns) {
  // One sample before the time is needed to tell what was then.
  while (samples_.size() > 1 && samples_[1].stamp_ns <= stamp_ns) samples_.pop_front();
}

std::optional<MotionPrior> MotionHistory::between(int64_t from_ns, int64_t to_ns) const {
  if (to_ns <= from_ns) return std::nullopt;
  auto prior = rates_ ? by_rates(samples_, from_ns, to_ns) : by_poses(samples_, drift_, from_ns, to_ns);
  if (prior && !is_plausible(*prior)) prior.reset();
  return prior;
}

MotionPrior moved_to_camera(const MotionPrior& prior, const Rigid3& cam_from_body) {
  Rigid3 mount = cam_from_body;
  if (prior.rotation_only) mount.translation.setZero();  // rotations are the same everywhere on the body
  return {mount * prior.previous_from_current * mount.inverse(), prior.rotation_only, carried(mount, prior.covariance)};
}

}  // namespace dkb
