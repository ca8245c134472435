// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/absolute_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "dkb/geometry/alignment.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

// Three different indices below n; n >= 3.
void draw_three(Random& random, uint32_t n, uint32_t (&sample)[3]) {
  sample[0] = random.below(n);
  do sample[1] = random.below(n);
  while (sample[1] == sample[0]);
  do sample[2] = random.below(n);
  while (sample[2] == sample[0] || sample[2] == sample[1]);
}

// Samples needed to draw one without outliers with this confidence.
int samples_needed(const RansacOptions& options, int inliers, size_t count) {
  const double share = static_cast<double>(inliers) / static_cast<double>(count);
  const double clean = share * share * share;
  if (clean >= 1) return 1;
  if (clean <= 0) return options.max_iterations;
  const double needed = std::log(1 - options.confidence) / std::log1p(-clean);
  return needed < options.max_iterations ? static_cast<int>(std::ceil(needed)) : options.max_iterations;
}

// Best hypothesis so far by the sum of squared errors cut off at their limits (MSAC, Torr and Zisserman 2000).
struct Best {
  Rigid3 pose;
  double loss = std::numeric_limits<double>::infinity();
  int inliers = 0;
};

// `chi2_of(pose, i)` is the squared error of correspondence i, `limit_of(i)` where it stops being an inlier.
template <class Chi2, class Limit>
bool offer(const Rigid3& pose, size_t count, const Chi2& chi2_of, const Limit& limit_of, Best& best) {
  double loss = 0;
  int inliers = 0;
  for (size_t i = 0; i < count && loss < best.loss; ++i) {
    const double chi2 = chi2_of(pose, i), limit = limit_of(i);
    const bool in = chi2 <= limit;
    inliers += in ? 1 : 0;
    loss += in ? chi2 / limit : 1.0;
  }
  if (!(loss < best.loss)) return false;
  best = {pose, loss, inliers};
  return true;
}

template <class Chi2, class Limit>
int mark_inliers(const Rigid3& pose, size_t count, const Chi2& chi2_of, const Limit& limit_of,
                 std::vector<uint8_t>& inlier) {
  inlier.assign(count, 0);
  for (size_t i = 0; i < count; ++i) inlier[i] = chi2_of(pose, i) <= limit_of(i);
  return static_cast<int>(std::count(inlier.begin(), inlier.end(), 1));
}

template <class T>
std::vector<T> only(std::span<const T> all, const std::vector<uint8_t>& marked) {
  std::vector<T> some;
  for (size_t i = 0; i < all.size(); ++i) {
    if (marked[i]) some.push_back(all[i]);
  }
  return some;
}

constexpr int kRefinements = 3;

}  // namespace

void RansacOptions::check() const {
  require_option(max_iterations >= 1, "max_iterations", max_iterations, ">= 1");
  require_option(confidence > 0 && confidence < 1, "confidence", confidence, "in (0, 1)");
  require_option(chi2 > 0, "chi2", chi2, "> 0");
  require_option(min_inliers >= 3, "min_inliers", min_inliers, ">= 3");
}

RansacPose estimate_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> observations,
                                  const RansacOptions& options) {
  options.check();
  const size_t count = observations.size();
  RansacPose result;
  result.inlier.assign(count, 0);
  if (count < static_cast<size_t>(options.min_inliers)) return result;

  const PoseOptions defaults;
  const auto chi2_of = [&](const Rigid3& pose, size_t i) {
    const PoseObservation& o = observations[i];
    const Eigen::Vector3d point = pose * o.point_in_world;
    if (!(point.z() > defaults.depth_in_front)) return std::numeric_limits<double>::infinity();
    const double pixel = ((camera.project(point) - o.pixel) / o.pixel_sigma).squaredNorm();
    const double depth = o.depth > 0 ? (point.z() - o.depth) / o.depth_sigma : 0.0;
    return pixel + depth * depth;
  };
  const auto limit_of = [&](size_t i) {
    return observations[i].depth > 0 ? options.chi2 * defaults.chi2_depth / defaults.chi2_pixel : options.chi2;
  };

  Random random(options.seed);
  Best best;
  int needed = options.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    uint32_t sample[3];
    draw_three(random, static_cast<uint32_t>(count), sample);
    Eigen::Vector3d points[3], rays[3];
    for (int k = 0; k < 3; ++k) {
      points[k] = observations[sample[k]].point_in_world;
      rays[k] = camera.unproject(observations[sample[k]].pixel, 1.0).normalized();
    }
    for (const Rigid3& pose : solve_p3p(points, rays)) {
      if (offer(pose, count, chi2_of, limit_of, best)) needed = samples_needed(options, best.inliers, count);
    }
  }
  if (best.inliers < 3) return result;

  Rigid3 pose = best.pose;
  mark_inliers(pose, count, chi2_of, limit_of, result.inlier);
  PoseOptions refine;
  refine.min_inliers = 3;
  for (int k = 0; k < kRefinements; ++k) {
    const PoseEstimate estimate = optimise_pose(camera, pose, only(observations, result.inlier), refine);
    if (!estimate.ok) break;
    pose = estimate.cam_from_world;
    const std::vector<uint8_t> before = result.inlier;
    mark_inliers(pose, count, chi2_of, limit_of, result.inlier);
    if (result.inlier == before) break;
  }
  result.inliers = static_cast<int>(std::count(result.inlier.begin(), result.inlier.end(), 1));
  result.ok = result.inliers >= options.min_inliers;
  if (result.ok) result.pose = pose;
  return result;
}

RansacPose estimate_rigid_motion(std::span<const Eigen::Vector3d> points_in_from,
                                 std::span<const Eigen::Vector3d> points_in_to, std::span<const double> sigma,
                                 const RansacOptions& options) {
  options.check();
  const size_t count = points_in_from.size();
  if (points_in_to.size() != count || sigma.size() != count) {
    throw InputError("rigid motion: " + std::to_string(count) + " points, " + std::to_string(points_in_to.size()) +
                     " counterparts and " + std::to_string(sigma.size()) + " sigmas; give as many of each");
  }
  RansacPose result;
  result.inlier.assign(count, 0);
  if (count < static_cast<size_t>(options.min_inliers)) return result;

  const auto chi2_of = [&](const Rigid3& pose, size_t i) {
    return (pose * points_in_from[i] - points_in_to[i]).squaredNorm() / (sigma[i] * sigma[i]);
  };
  const auto limit_of = [&](size_t) { return options.chi2; };
  // A triangle whose sides changed, or that is nearly a line, cannot give the motion.
  const auto sound = [&](const Eigen::Vector3d(&from)[3], const Eigen::Vector3d(&to)[3], const double(&s)[3]) {
    double longest = 0;
    for (int k = 0; k < 3; ++k) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double a = (from[i] - from[j]).norm(), b = (to[i] - to[j]).norm();
      if (std::abs(a - b) > std::sqrt(options.chi2) * (s[i] + s[j])) return false;
      longest = std::max(longest, a);
    }
    return (from[1] - from[0]).cross(from[2] - from[0]).norm() > 0.02 * longest * longest;
  };

  Random random(options.seed);
  Best best;
  int needed = options.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    uint32_t sample[3];
    draw_three(random, static_cast<uint32_t>(count), sample);
    Eigen::Vector3d from[3], to[3];
    double s[3];
    for (int k = 0; k < 3; ++k) {
      from[k] = points_in_from[sample[k]];
      to[k] = points_in_to[sample[k]];
      s[k] = sigma[sample[k]];
    }
    if (!sound(from, to, s)) continue;
    const Rigid3 pose = align_umeyama(from, to, false).motion;
    if (offer(pose, count, chi2_of, limit_of, best)) needed = samples_needed(options, best.inliers, count);
  }
  if (best.inliers < 3) return result;

  Rigid3 pose = best.pose;
  mark_inliers(pose, count, chi2_of, limit_of, result.inlier);
  for (int k = 0; k < kRefinements; ++k) {
    const Rigid3 refined =
        align_umeyama(only(points_in_from, result.inlier), only(points_in_to, result.inlier), false).motion;
    std::vector<uint8_t> inlier;
    const int inliers = mark_inliers(refined, count, chi2_of, limit_of, inlier);
    if (inliers < 3) break;
    pose = refined;
    const bool settled = inlier == result.inlier;
    result.inlier = std::move(inlier);
    if (settled) break;
  }
  result.inliers = static_cast<int>(std::count(result.inlier.begin(), result.inlier.end(), 1));
  result.ok = result.inliers >= options.min_inliers;
  if (result.ok) result.pose = pose;
  return result;
}

}  // namespace dkb
