// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/trajectory_error.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
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

// Index, `begin` or later, of the one of these numbers, which do not fall, that is nearest to `value`, the first of
// equally near ones. There is one.
size_t nearest(const std::vector<double>& numbers, size_t begin, double value) {
  const auto first = numbers.begin() + static_cast<std::ptrdiff_t>(begin);
  auto at = std::lower_bound(first, numbers.end(), value);
  if (at != first) {
    const auto below = std::lower_bound(first, numbers.end(), *(at - 1));
    if (at == numbers.end() || std::abs(*at - value) >= std::abs(*below - value)) at = below;
  }
  return static_cast<size_t>(at - numbers.begin());
}

// From every pose to the later one that is nearest to delta away.
std::vector<std::pair<size_t, size_t>> all_relative_pairs(const Evaluation& e) {
  constexpr double kTolerance = 0.1;  // of delta, as evo's
  const RpeDelta& delta = e.options.rpe_delta;
  const size_t n = e.estimate.size();
  std::vector<double> along(n, 0);  // in the unit of delta
  for (size_t i = 1; i < n; ++i)
    along[i] = delta.unit == DeltaUnit::frames ? static_cast<double>(i)
               : delta.unit == DeltaUnit::seconds
                   ? e.timestamps[i] - e.timestamps[0]
                   : along[i - 1] + (e.estimate[i].translation - e.estimate[i - 1].translation).norm();
  const double tolerance = delta.unit == DeltaUnit::frames ? 0 : kTolerance * delta.value;
  std::vector<std::pair<size_t, size_t>> pairs;
  for (size_t i = 0; i + 1 < n; ++i) {
    const size_t j = nearest(along, i + 1, along[i] + delta.value);
    if (std::abs(along[j] - along[i] - delta.value) <= tolerance) pairs.emplace_back(i, j);
  }
  return pairs;
}

std::vector<std::pair<size_t, size_t>> relative_pairs(const Evaluation& e) {
  if (e.options.rpe_all_pairs) return all_relative_pairs(e);
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

// Standard deviations of points along their three main directions, the widest first, [m].
Eigen::Vector3d spreads(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) mean += p / static_cast<double>(points.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) scatter += (p - mean) * (p - mean).transpose();
  const Eigen::Vector3d variances = spectrum(Eigen::Matrix3d(scatter / static_cast<double>(points.size()))).values;
  return variances.reverse().cwiseMax(0).cwiseSqrt();
}

// Whether paths leave a line by more than files round: a share of its length and, for the truth, which is in metres, a
// length. What is on a line can be turned about it.
bool leave_a_line(const std::vector<Eigen::Vector3d>& estimate, const std::vector<Eigen::Vector3d>& truth) {
  constexpr double kLeastShare = 1e-4, kLeast = 1e-4;  // [m]
  const Eigen::Vector3d e = spreads(estimate), t = spreads(truth);
  // Means of positions far from the origin are rounded, which looks like an offset across.
  const double far = 1e-12 * std::max(estimate.front().norm(), truth.front().norm());
  return t[1] > std::max({kLeast, far, kLeastShare * t[0]}) && e[1] > std::max(far, kLeastShare * e[0]);
}

// [m] Standard error of a mean of the errors' coordinates. Errors of neighbours are alike, so that n of them count for
// n (1 - r) / (1 + r), by the correlation r of neighbours (first-order autoregression).
double standard_error(const std::vector<Eigen::Vector3d>& errors) {
  double squares = 0, products = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    squares += errors[i].squaredNorm();
    if (i > 0) products += errors[i].dot(errors[i - 1]);
  }
  if (!(squares > 0)) return 0;
  const double n = static_cast<double>(errors.size()), r = std::clamp(products / squares, 0.0, 1.0);
  const double independent = std::max(1.0, n * (1 - r) / (1 + r));
  return std::sqrt(squares / (3 * n) / independent);
}

// [deg] Standard error of the rotation that aligns positions, about their longest line: how far it turns the others.
double rotation_sd(const std::vector<Eigen::Vector3d>& errors, const std::vector<Eigen::Vector3d>& truth) {
  return standard_error(errors) / spreads(truth).tail<2>().norm() * 180 / std::numbers::pi;
}

std::vector<Eigen::Vector3d> errors_after(const Similarity3& to_from_from, const std::vector<Eigen::Vector3d>& from,
                                          const std::vector<Eigen::Vector3d>& to) {
  std::vector<Eigen::Vector3d> errors;
  for (size_t i = 0; i < from.size(); ++i) errors.push_back(to_from_from * from[i] - to[i]);
  return errors;
}

// How many standard errors, told from errors with so many degrees of freedom, are as rare as five of a normal
// distribution: those of few errors are rough themselves. Wallace's approximation of Student's t without its last term.
double five_standard_errors(double freedom) {
  return std::sqrt(freedom * std::expm1(25 / freedom));
}

// By how much the estimate is to be enlarged, where that is another than 1 by a tenth, which no camera's calibration is
// off by, and by five standard errors. The estimate's size is fitted to the truth, which has no errors, and not the
// other way round: errors that are larger than the way would make the fit smaller.
//
// An error that wanders off looks like a wrong size as long as the way is short, and what the fit leaves of it tells
// little of that. So the way's steps count, between up to eleven poses: their errors are independent where the error
// wanders as a random walk does; where errors are independent themselves those of steps oppose each other, and the
// standard error is too large rather than too small. Where the error wanders smoothly, k steps count for
// k (1 - r) / (1 + r) by the correlation r of neighbours (first-order autoregression), which a fit of four numbers,
// rotation and size, makes look smaller by 4/3 (1 + r) / k.
std::optional<double> wrong_scale(const std::vector<Eigen::Vector3d>& estimate,
                                  const std::vector<Eigen::Vector3d>& truth) {
  constexpr double kLeast = 0.1, kFitted = 4;
  constexpr size_t kMostSteps = 10;
  const Similarity3 fit = align_umeyama(truth, estimate, true);
  if (!(fit.scale > 0) || !(std::abs(std::log(fit.scale)) > kLeast)) return {};
  const size_t last = truth.size() - 1, steps = std::min(last, kMostSteps);
  const std::vector<Eigen::Vector3d> errors = errors_after(fit, truth, estimate);
  double way = 0, squares = 0, products = 0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero();
  for (size_t i = 0; i < steps; ++i) {
    const size_t from = i * last / steps, to = (i + 1) * last / steps;
    const Eigen::Vector3d error = errors[to] - errors[from];
    way += (truth[to] - truth[from]).squaredNorm();
    squares += error.squaredNorm();
    products += error.dot(before);
    before = error;
  }
  const double k = static_cast<double>(steps), seen = squares > 0 ? products / squares : 0;
  const double r = std::clamp(seen + kFitted / 3 * (1 + seen) / k, 0.0, 1.0);
  const double independent = k * (1 - r) / (1 + r), freedom = 3 * independent - kFitted;
  if (!(freedom >= 1)) return {};
  const double variance = squares / (3 * k) * (3 * independent / freedom);  // [m^2] of a step's coordinate
  const double standard_error = std::sqrt(variance * k / (independent * way));
  if (!(std::abs(fit.scale - 1) >= five_standard_errors(freedom) * standard_error)) return {};
  return 1 / fit.scale;
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

const char* name_of(Alignment alignment) {
  constexpr const char* kNames[] = {"se3", "sim3", "origin", "none"};
  return kNames[static_cast<size_t>(alignment)];
}

Alignment alignment_named(const std::string& name, const std::string& where) {
  for (const Alignment a : {Alignment::se3, Alignment::sim3, Alignment::origin, Alignment::none})
    if (name == name_of(a)) return a;
  throw InputError(where + ": \"" + name + "\" is none of se3, sim3, origin and none");
}

void EvaluationOptions::check() const {
  require_option(std::isfinite(max_difference) && max_difference >= 0, "max-diff", max_difference, "at least 0 s");
  require_option(std::isfinite(time_offset), "time-offset", time_offset, "a number of seconds");
  rpe_delta.check();
}

double median_of(std::vector<double> values) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
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
  const auto [least, most] = std::minmax_element(errors.begin(), errors.end());
  s.min = *least, s.max = *most;
  s.median = median_of(errors);
  return s;
}

std::vector<std::pair<size_t, size_t>> match_stamps(const Trajectory& a, const Trajectory& b, double max_difference) {
  const bool walk_a = a.size() < b.size();
  const Trajectory &shorter = walk_a ? a : b, &longer = walk_a ? b : a;
  std::vector<double> stamps;
  for (const StampedPose& pose : longer) stamps.push_back(pose.timestamp);
  std::vector<std::pair<size_t, size_t>> matches;
  for (size_t i = 0; i < shorter.size() && !longer.empty(); ++i) {
    const size_t j = nearest(stamps, 0, shorter[i].timestamp);
    if (std::abs(longer[j].timestamp - shorter[i].timestamp) > max_difference) continue;
    matches.emplace_back(walk_a ? i : j, walk_a ? j : i);
  }
  return matches;
}

Evaluation evaluate(const Trajectory& truth, const Trajectory& given, const EvaluationOptions& options,
                    const std::string& name) {
  options.check();
  const std::string whose = name.empty() ? name : name + ": ";
  if (given.empty()) throw InputError(whose + "the estimate has no poses; was every frame lost?");
  if (truth.empty()) throw InputError("the truth has no poses");
  Trajectory estimate = given;
  for (StampedPose& pose : estimate) pose.timestamp += options.time_offset;
  Evaluation e;
  e.options = options;
  e.truth_poses = truth.size(), e.estimated_poses = estimate.size();
  std::vector<Eigen::Vector3d> from, to;
  const auto matches = match_stamps(truth, estimate, options.max_difference);
  if (matches.size() < 2)
    throw InputError(
        whose + fmt::format("{} of {} estimated and {} true poses match within {} s; at least 2 must (are both of one "
                            "recording and one clock?)",
                            matches.size(), estimate.size(), truth.size(), options.max_difference));
  for (const auto& [i, j] : matches) {
    e.timestamps.push_back(estimate[j].timestamp);
    to.push_back(truth[i].world_from_cam.translation);
    from.push_back(estimate[j].world_from_cam.translation);
  }

  const bool by_positions = options.alignment == Alignment::se3 || options.alignment == Alignment::sim3;
  if (by_positions) {
    e.truth_from_estimate = align_umeyama(from, to, options.alignment == Alignment::sim3);
  } else if (options.alignment == Alignment::origin) {
    const auto& [i, j] = matches.front();
    e.truth_from_estimate.motion = truth[i].world_from_cam * estimate[j].world_from_cam.inverse();
  }
  // A wrong scale is an error of its own, and leaves the rotation as it is.
  const Similarity3 best = align_umeyama(from, to, true);
  const std::vector<Eigen::Vector3d> errors = errors_after(best, from, to);
  if (options.alignment != Alignment::sim3) e.wrong_scale = wrong_scale(from, to);
  if (by_positions) e.rotation_sd_deg = leave_a_line(from, to) ? rotation_sd(errors, to) : INFINITY;
  const Similarity3& s = e.truth_from_estimate;
  for (const auto& [i, j] : matches) {
    const Rigid3 &t = truth[i].world_from_cam, &x = estimate[j].world_from_cam;
    e.truth.push_back(t);
    e.estimate.emplace_back((s.motion.rotation * x.rotation).normalized(), s * x.translation);
    e.ape.translation_m.push_back((e.estimate.back().translation - t.translation).norm());
    if (e.rotation_determined()) e.ape.rotation_deg.push_back(degrees_between(t.rotation, e.estimate.back().rotation));
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

Trajectory read_poses(const std::filesystem::path& path, size_t* hidden) {
  std::error_code error;
  if (std::filesystem::is_directory(path, error)) {
    const bool sequence = std::filesystem::exists(path / "groundtruth.txt", error);
    throw InputError(path.string() + ": is a folder; give the trajectory in it, as " +
                     (path / (sequence ? "groundtruth.txt" : "trajectory.txt")).string());
  }
  Trajectory trajectory = hidden != nullptr ? read_truth(path, hidden) : read_trajectory(path);
  if (trajectory.empty()) throw InputError(path.string() + ": holds no pose `timestamp tx ty tz qx qy qz qw`");
  return trajectory;
}

}  // namespace dkb
