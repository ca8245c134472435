// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/trajectory_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "dkb/geometry/decompositions.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

double degrees_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return vector_from_rotation(a.conjugate() * b).norm() * 180.0 / std::numbers::pi;
}

// Index of the stamp nearest to `t`, the first of equally near ones. `trajectory` is sorted and not empty.
size_t nearest_stamp(const Trajectory& trajectory, double t) {
  const auto before = [](const StampedPose& pose, double stamp) { return pose.timestamp < stamp; };
  const auto first_of = [&](double stamp) {
    return static_cast<size_t>(std::lower_bound(trajectory.begin(), trajectory.end(), stamp, before) -
                               trajectory.begin());
  };
  const size_t above = first_of(t);
  if (above == 0) return 0;
  const size_t below = first_of(trajectory[above - 1].timestamp);
  if (above == trajectory.size()) return below;
  return std::abs(trajectory[above].timestamp - t) < std::abs(trajectory[below].timestamp - t) ? above : below;
}

std::vector<std::pair<size_t, size_t>> relative_pairs(const Evaluation& e) {
  const RpeDelta& delta = e.options.rpe_delta;
  const size_t n = e.estimate.size();
  std::vector<size_t> cuts;
  if (delta.unit == DeltaUnit::frames) {
    for (size_t i = 0; i < n; i += static_cast<size_t>(delta.value)) cuts.push_back(i);
  } else if (delta.unit == DeltaUnit::metres) {
    double path = 0;
    for (size_t i = 0; i < n; ++i) {
      if (i > 0) path += (e.estimate[i].translation - e.estimate[i - 1].translation).norm();
      if (path < delta.value) continue;
      cuts.push_back(i);
      path = 0;
    }
  } else {
    for (size_t i = 0; i < n; ++i)
      if (cuts.empty() || e.timestamps[i] - e.timestamps[cuts.back()] >= delta.value - kStampRounding)
        cuts.push_back(i);
  }
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 1; i < cuts.size(); ++i) pairs.emplace_back(cuts[i - 1], cuts[i]);
  return pairs;
}

// Standard deviations of points along their two widest directions, [m].
Eigen::Vector2d spreads(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::Vector3d variances = spectrum(Eigen::Matrix3d(scatter / static_cast<double>(points.size()))).values;
  return variances.tail<2>().reverse().cwiseMax(0).cwiseSqrt();
}

// Whether positions determine the rotation that aligns them: both paths leave a line by more than files round, a share
// of its length and, for the truth, which is in metres, a length.
bool determines_rotation(const std::vector<Eigen::Vector3d>& estimate, const std::vector<Eigen::Vector3d>& truth) {
  constexpr double kLeastShare = 1e-4, kLeast = 1e-4;  // [m]
  const Eigen::Vector2d e = spreads(estimate), t = spreads(truth);
  // Means of positions far from the origin are rounded, which looks like an offset across.
  const double far = 1e-12 * std::max(estimate.front().norm(), truth.front().norm());
  return t[1] > std::max({kLeast, far, kLeastShare * t[0]}) && e[1] > std::max(far, kLeastShare * e[0]);
}

void add_statistics(PoseErrors* errors) {
  errors->translation = error_statistics(errors->translation_m);
  errors->rotation = error_statistics(errors->rotation_deg);
}

}  // namespace

void RpeDelta::check() const {
  require_option(std::isfinite(value) && value > 0, "rpe-delta", value, "greater than 0");
  if (unit == DeltaUnit::frames)
    require_option(value <= 1e9 && value == std::floor(value), "rpe-delta", value, "a whole number of frames");
}

RpeDelta parse_rpe_delta(const std::string& text) {
  RpeDelta delta;
  const std::string_view number = std::string_view(text).substr(0, text.empty() ? 0 : text.size() - 1);
  const char unit = text.empty() ? ' ' : text.back();
  if ((unit != 'f' && unit != 'm' && unit != 's') || !parse_number(number, &delta.value))
    throw InputError("rpe-delta: \"" + text +
                     "\" is not a number with its unit: 1f (frames), 0.5m (metres) or 1s (seconds)");
  delta.unit = unit == 'f' ? DeltaUnit::frames : unit == 'm' ? DeltaUnit::metres : DeltaUnit::seconds;
  delta.check();
  return delta;
}

std::string to_string(const RpeDelta& delta) {
  const char* unit = delta.unit == DeltaUnit::frames ? "f" : delta.unit == DeltaUnit::metres ? "m" : "s";
  return fmt::format("{}{}", delta.value, unit);
}

void EvaluationOptions::check() const {
  require_option(std::isfinite(max_difference) && max_difference >= 0, "max-diff", max_difference, "at least 0 s");
  rpe_delta.check();
}

ErrorStatistics error_statistics(const std::vector<double>& errors) {
  ErrorStatistics s;
  s.count = errors.size();
  if (errors.empty()) return s;
  const double n = static_cast<double>(errors.size());
  double sum = 0, squares = 0;
  for (const double e : errors) sum += e, squares += e * e;
  s.mean = sum / n;
  s.rmse = std::sqrt(squares / n);
  double deviations = 0;
  for (const double e : errors) deviations += (e - s.mean) * (e - s.mean);
  s.std = std::sqrt(deviations / n);
  std::vector<double> sorted = errors;
  std::sort(sorted.begin(), sorted.end());
  s.min = sorted.front(), s.max = sorted.back();
  const size_t middle = sorted.size() / 2;
  s.median = sorted.size() % 2 == 1 ? sorted[middle] : 0.5 * (sorted[middle - 1] + sorted[middle]);
  return s;
}

std::vector<std::pair<size_t, size_t>> match_stamps(const Trajectory& a, const Trajectory& b, double max_difference) {
  const bool walk_a = a.size() < b.size();
  const Trajectory &shorter = walk_a ? a : b, &longer = walk_a ? b : a;
  std::vector<std::pair<size_t, size_t>> matches;
  for (size_t i = 0; i < shorter.size() && !longer.empty(); ++i) {
    const size_t j = nearest_stamp(longer, shorter[i].timestamp);
    if (std::abs(longer[j].timestamp - shorter[i].timestamp) > max_difference) continue;
    matches.emplace_back(walk_a ? i : j, walk_a ? j : i);
  }
  return matches;
}

Evaluation evaluate(const Trajectory& truth, const Trajectory& estimate, const EvaluationOptions& options,
                    const std::string& name) {
  options.check();
  Evaluation e;
  e.options = options;
  e.truth_poses = truth.size(), e.estimated_poses = estimate.size();
  std::vector<Eigen::Vector3d> from, to;
  const auto matches = match_stamps(truth, estimate, options.max_difference);
  if (matches.size() < 2)
    throw InputError(
        (name.empty() ? name : name + ": ") +
        fmt::format("{} of {} estimated and {} true poses match within {} s; at least 2 must (are both of one "
                    "recording and one clock?)",
                    matches.size(), estimate.size(), truth.size(), options.max_difference));
  for (const auto& [i, j] : matches) {
    e.timestamps.push_back(estimate[j].timestamp);
    to.push_back(truth[i].world_from_cam.translation);
    from.push_back(estimate[j].world_from_cam.translation);
  }

  e.truth_from_estimate = align_umeyama(from, to, options.with_scale);
  e.rotation_determined = determines_rotation(from, to);
  const Similarity3& s = e.truth_from_estimate;
  for (const auto& [i, j] : matches) {
    const Rigid3 &t = truth[i].world_from_cam, &x = estimate[j].world_from_cam;
    e.truth.push_back(t);
    e.estimate.emplace_back((s.motion.rotation * x.rotation).normalized(), s * x.translation);
    e.ape.translation_m.push_back((e.estimate.back().translation - t.translation).norm());
    if (e.rotation_determined) e.ape.rotation_deg.push_back(degrees_between(t.rotation, e.estimate.back().rotation));
  }
  add_statistics(&e.ape);

  e.rpe_pairs = relative_pairs(e);
  for (const auto& [i, j] : e.rpe_pairs) {
    const Rigid3 true_motion = e.truth[i].inverse() * e.truth[j];
    const Rigid3 motion = e.estimate[i].inverse() * e.estimate[j];
    const Rigid3 error = true_motion.inverse() * motion;
    e.rpe.translation_m.push_back(error.translation.norm());
    e.rpe.rotation_deg.push_back(vector_from_rotation(error.rotation).norm() * 180.0 / std::numbers::pi);
  }
  add_statistics(&e.rpe);
  return e;
}

Trajectory read_poses(const std::filesystem::path& path) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    const bool sequence = std::filesystem::exists(path / "groundtruth.txt", error);
    throw InputError(path.string() + ": is a folder; give the trajectory in it, as " +
                     (path / (sequence ? "groundtruth.txt" : "trajectory.txt")).string());
  }
  Trajectory trajectory = read_trajectory(path);
  if (trajectory.empty()) throw InputError(path.string() + ": holds no pose `timestamp tx ty tz qx qy qz qw`");
  return trajectory;
}

}  // namespace dkb
