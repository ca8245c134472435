// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/absolute_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dkb/util/chi_square.h"
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

constexpr int kMaxSamples = 300;
constexpr double kConfidence = 0.999;  // of having drawn one sample without outliers; ends early

int samples_needed(int inliers, size_t count) {
  const double share = static_cast<double>(inliers) / static_cast<double>(count);
  const double clean = share * share * share;
  if (clean >= 1) return 1;
  if (clean <= 0) return kMaxSamples;
  const double needed = std::log(1 - kConfidence) / std::log1p(-clean);
  return needed < kMaxSamples ? static_cast<int>(std::ceil(needed)) : kMaxSamples;
}

// A hypothesis by the sum of squared errors cut off at their limits (MSAC, Torr and Zisserman 2000).
struct Best {
  Rigid3 pose;
  double loss = std::numeric_limits<double>::infinity();
  int inliers = 0;
};

// Squared errors of the observations, and where they stop being inliers.
class Errors {
 public:
  Errors(const CameraModel& camera, std::span<const PoseObservation> observations)
      : camera_(camera), observations_(observations) {}

  // True where it is better than the best so far, which it then is.
  bool offer(const Rigid3& pose, Best& best) const {
    double loss = 0;
    int inliers = 0;
    for (size_t i = 0; i < observations_.size() && loss < best.loss; ++i) {
      const double share = of_limit(pose, observations_[i]);
      inliers += share <= 1;
      loss += std::min(share, 1.0);
    }
    if (!(loss < best.loss)) return false;
    best = {pose, loss, inliers};
    return true;
  }
  std::vector<uint8_t> inliers(const Rigid3& pose) const {
    std::vector<uint8_t> inlier;
    for (const PoseObservation& o : observations_) inlier.push_back(of_limit(pose, o) <= 1);
    return inlier;
  }

 private:
  double of_limit(const Rigid3& pose, const PoseObservation& o) const {
    const Eigen::Vector3d point = pose * o.point_in_world;
    if (!(point.z() > kDepthInFront)) return std::numeric_limits<double>::infinity();
    const double pixel = ((camera_.project(point) - o.pixel) / o.pixel_sigma).squaredNorm();
    const double depth = o.depth > 0 ? (point.z() - o.depth) / o.depth_sigma : 0.0;
    return (pixel + depth * depth) / (o.depth > 0 ? kChi2ThreeDof95 : kChi2TwoDof95);
  }

  const CameraModel& camera_;
  const std::span<const PoseObservation> observations_;
};

std::vector<PoseObservation> only(std::span<const PoseObservation> all, const std::vector<uint8_t>& marked) {
  std::vector<PoseObservation> some;
  for (size_t i = 0; i < all.size(); ++i)
    if (marked[i]) some.push_back(all[i]);
  return some;
}

constexpr int kRefinements = 3;

}  // namespace

void RansacOptions::check() const {
  require_option(min_inliers >= 3, "min_inliers", min_inliers, ">= 3");
}

RansacPose estimate_absolute_pose(const CameraModel& camera, std::span<const PoseObservation> observations,
                                  const RansacOptions& options) {
  options.check();
  const size_t count = observations.size();
  RansacPose result;
  result.inlier.assign(count, 0);
  if (count < static_cast<size_t>(options.min_inliers)) return result;

  const Errors errors(camera, observations);
  Random random(options.seed);
  Best best;
  int needed = kMaxSamples;
  for (; result.iterations < needed; ++result.iterations) {
    uint32_t sample[3];
    draw_three(random, static_cast<uint32_t>(count), sample);
    Eigen::Vector3d points[3], rays[3];
    for (int k = 0; k < 3; ++k) {
      points[k] = observations[sample[k]].point_in_world;
      rays[k] = camera.unproject(observations[sample[k]].pixel, 1.0).normalized();
    }
    for (const Rigid3& pose : solve_p3p(points, rays)) {
      if (errors.offer(pose, best)) needed = samples_needed(best.inliers, count);
    }
  }
  if (best.inliers < 3) return result;

  Rigid3 pose = best.pose;
  result.inlier = errors.inliers(pose);
  PoseOptions refine;
  refine.min_inliers = 3;
  for (int k = 0; k < kRefinements; ++k) {
    const PoseEstimate estimate = optimise_pose(camera, pose, only(observations, result.inlier), refine);
    if (!estimate.ok) break;
    pose = estimate.cam_from_world;
    const std::vector<uint8_t> before = std::exchange(result.inlier, errors.inliers(pose));
    if (result.inlier == before) break;
  }
  result.inliers = static_cast<int>(std::count(result.inlier.begin(), result.inlier.end(), 1));
  result.ok = result.inliers >= options.min_inliers;
  if (result.ok) result.pose = pose;
  return result;
}

}  // namespace dkb
