// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_optimiser.h"

#include <algorithm>
#include <cmath>

#include "dkb/geometry/decompositions.h"
#include "dkb/solver/kernels.h"
#include "dkb/solver/relative_pose.h"
#include "dkb/util/chi_square.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

using solver::CameraPose;

constexpr double kMedianChi2 = 1.386;  // of two degrees of freedom
// By Student's weights a Gaussian's errors in the plane give a variance of 1.0925 where the weights, 1.084 on average,
// claim 1 / 1.084: E[w^2 x] / 2 / E[24 / (4 + x)^2]^2 with w = 6 / (4 + x) and x of two degrees of freedom.
constexpr double kClaim = 1 / (1.0925 * 1.084);
constexpr double kUsualScale = 20;  // observations of the sigmas as given that stand beside those at hand

constexpr int kPoseRounds = 4;    // classifications of inliers, each followed by an optimisation
constexpr int kRobustRounds = 2;  // first ones that use the Huber kernel
constexpr int kRoundSteps = 10;   // of Levenberg-Marquardt, at most
// [m, rad] a step below both ends a round.
constexpr double kSmallTranslation = 1e-4, kSmallRotation = 1e-4;

// The observations as arrays, in groups of four, and the sums over them at a pose.
class PoseProblem {
 public:
  PoseProblem(const CameraModel& camera, std::span<const PoseObservation> observations, const PosePrior* prior)
      : count_(observations.size()), padded_((count_ + 3) / 4 * 4), prior_(prior) {
    values_.assign(padded_ * kArrays, 0.0);
    for (size_t i = 0; i < count_; ++i) {
      const PoseObservation& o = observations[i];
      array(kX)[i] = o.point_in_world.x();
      array(kY)[i] = o.point_in_world.y();
      array(kZ)[i] = o.point_in_world.z();
      array(kU)[i] = o.pixel.x();
      array(kV)[i] = o.pixel.y();
      array(kGiven)[i] = o.weight;
      const double share = std::sqrt(o.weight);
      array(kInvSigma)[i] = share / o.pixel_sigma;
      if (o.depth > 0) {
        array(kDepth)[i] = o.depth;
        array(kInvDepthSigma)[i] = share / o.depth_sigma;
      }
    }
    input_.camera = {camera.fx, camera.fy, camera.cx, camera.cy, {}, {}, kDepthInFront};
    input_.observations = {array(kU), array(kV), array(kInvSigma), array(kDepth), nullptr, array(kWeight)};
    input_.x = array(kX);
    input_.y = array(kY);
    input_.z = array(kZ);
    input_.count = static_cast<int>(padded_);
  }

  // How each observation fits at a pose.
  void judge(const Rigid3& pose) {
    set_pose(pose);
    input_.observations.inv_depth_sigma = array(kInvDepthSigma);
    kernels_.pose_chi2(input_, array(kChi2));
  }
  // Observations within the limit, as judged.
  std::vector<uint8_t> inliers() const {
    std::vector<uint8_t> inlier(count_);
    for (size_t i = 0; i < count_; ++i) inlier[i] = array(kChi2)[i] <= limit(i);
    return inlier;
  }

  // Observations that take part from now on.
  void use(const std::vector<uint8_t>& inlier) {
    for (size_t i = 0; i < count_; ++i) {
      array(kWeight)[i] = inlier[i] ? 1.0 : 0.0;
      array(kUsedInvDepthSigma)[i] = inlier[i] ? array(kInvDepthSigma)[i] : 0.0;
    }
  }
  // The same, each weighed by how it fits, as judged, by its own sigmas, all `times` as much.
  void weigh(const std::vector<uint8_t>& inlier, double times = 1) {
    use(inlier);
    const double* const chi2 = array(kChi2);
    double* const own = array(kOwnChi2);
    double* const fits = array(kFits);
    double* end = fits;
    for (size_t i = 0; i < count_; ++i) {
      own[i] = chi2[i] / array(kGiven)[i];
      if (inlier[i]) *end++ = own[i];
    }
    if (end == fits) return;
    const double variance = variance_by_median({fits, end});
    for (size_t i = 0; i < count_; ++i) {
      if (!inlier[i]) continue;
      const double weight = student_weight(own[i] / variance, times);
      array(kWeight)[i] = weight;
      array(kUsedInvDepthSigma)[i] = array(kInvDepthSigma)[i] * std::sqrt(weight);
    }
  }
  std::vector<uint8_t> in_front() const {
    std::vector<uint8_t> in_front(count_);
    for (size_t i = 0; i < count_; ++i) in_front[i] = std::isfinite(array(kChi2)[i]);
    return in_front;
  }

  struct Normal {
    Matrix6d information;  // A^T M A
    Vector6d gradient;     // half the derivative of the cost
    double cost;
  };
  Normal normal_at(const Rigid3& pose, bool robust) {
    Normal n = of_observations(pose, robust);
    add_prior(pose, &n);
    return n;
  }
  Normal of_observations(const Rigid3& pose, bool robust) {
    set_pose(pose);
    input_.observations.inv_depth_sigma = array(kUsedInvDepthSigma);
    input_.limits = {robust, kChi2TwoDof95, kChi2ThreeDof95};
    double sums[solver::kPoseSums];
    kernels_.pose_sums(input_, sums);
    Normal n;
    const double* h = sums;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) n.information(i, j) = n.information(j, i) = *h++;
    }
    for (int i = 0; i < 6; ++i) n.gradient[i] = *h++;
    n.cost = *h;
    return n;
  }
  void add_prior(const Rigid3& pose, Normal* n) const {
    if (prior_ == nullptr) return;
    // Between this camera and one at the prior's pose no motion was "measured".
    const auto r = solver::relative_pose_residual(pose, prior_->cam_from_world, Rigid3());
    n->information += r.jacobian_a.transpose() * prior_->information * r.jacobian_a;
    n->gradient += r.jacobian_a.transpose() * prior_->information * r.error;
    n->cost += r.error.dot(prior_->information * r.error);
  }

 private:
  enum Array {
    kX,
    kY,
    kZ,
    kU,
    kV,
    kInvSigma,
    kDepth,
    kInvDepthSigma,
    kUsedInvDepthSigma,
    kWeight,
    kChi2,
    kOwnChi2,
    kFits,
    kGiven,
    kArrays
  };

  double* array(Array a) { return values_.data() + padded_ * a; }
  const double* array(Array a) const { return values_.data() + padded_ * a; }
  // Of the square of an error: inliers are within it, where the Huber kernel has its corner.
  double limit(size_t i) const { return array(kInvDepthSigma)[i] > 0 ? kChi2ThreeDof95 : kChi2TwoDof95; }
  void set_pose(const Rigid3& pose) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(input_.camera.rotation) = pose.matrix3();
    Eigen::Map<Eigen::Vector3d>(input_.camera.translation) = pose.translation;
  }

  const size_t count_, padded_;
  const PosePrior* prior_;
  const solver::SolverKernels& kernels_ = solver::solver_kernels();
  std::vector<double> values_;
  solver::PoseInput input_{};
};

// Levenberg-Marquardt from `pose` with the observations in use.
void descend(PoseProblem& problem, bool robust, Rigid3& pose) {
  double damping = 1e-6;
  PoseProblem::Normal normal = problem.normal_at(pose, robust);
  for (int tried = 0; tried < kRoundSteps; ++tried) {
    Matrix6d damped = normal.information;
    // The floor keeps directions without information where they are.
    damped.diagonal() += damping * normal.information.diagonal() + Vector6d::Constant(1e-9);
    const Vector6d step = -solve_symmetric(damped, normal.gradient);
    if (!step.allFinite()) break;
    const Rigid3 candidate = solver::perturbed(pose, step);
    const bool small = step.head<3>().norm() <= kSmallTranslation && step.tail<3>().norm() <= kSmallRotation;
    const PoseProblem::Normal next = problem.normal_at(candidate, robust);
    if (next.cost <= normal.cost) {
      pose = candidate;
      normal = next;
      damping = std::max(0.1 * damping, 1e-12);
    } else {
      damping = std::max(damping, 1e-6) * 10;
    }
    if (small) break;
  }
}

// A Gauss-Newton step with the observations in use, for a pose that lies near its minimum.
Rigid3 one_step(PoseProblem& problem, const Rigid3& pose) {
  PoseProblem::Normal normal = problem.normal_at(pose, false);
  normal.information.diagonal().array() += 1e-9;
  const Vector6d step = -solve_symmetric(normal.information, normal.gradient);
  return step.allFinite() ? solver::perturbed(pose, step) : pose;
}

}  // namespace

double variance_by_median(std::span<double> squares) {
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  const auto n = static_cast<double>(squares.size());
  return (n * *middle / kMedianChi2 + kUsualScale) / (n + kUsualScale);
}

void PoseOptions::check() const {
  require_option(tail_rounds >= 0, "tail_rounds", tail_rounds, ">= 0");
  require_option(min_inliers >= 3, "min_inliers", min_inliers, ">= 3");
}

PoseEstimate optimise_pose(const CameraModel& camera, const Rigid3& cam_from_world_initial,
                           std::span<const PoseObservation> observations, const PoseOptions& options,
                           const PosePrior* prior) {
  options.check();
  PoseEstimate estimate;
  estimate.cam_from_world = cam_from_world_initial;
  PoseProblem problem(camera, observations, prior);

  Rigid3 pose = cam_from_world_initial;
  problem.judge(pose);
  std::vector<uint8_t> used = problem.in_front();
  for (int round = 0; round < kPoseRounds; ++round) {
    problem.use(used);
    descend(problem, round < kRobustRounds, pose);
    problem.judge(pose);
    estimate.inlier = problem.inliers();
    // Within the limit, which is the kernel's corner, the kernel is least squares: the same observations would give
    // the same pose again, with the kernel or without.
    if (estimate.inlier == used) break;
    used = estimate.inlier;
  }
  for (int round = 0; round < options.tail_rounds; ++round) {
    problem.weigh(estimate.inlier);
    pose = one_step(problem, pose);
    problem.judge(pose);
  }
  estimate.inlier = problem.inliers();
  if (options.tail_rounds > 0)
    problem.weigh(estimate.inlier, kClaim);
  else
    problem.use(estimate.inlier);

  estimate.inliers = static_cast<int>(std::count(estimate.inlier.begin(), estimate.inlier.end(), 1));
  const PoseProblem::Normal seen = problem.of_observations(pose, false);
  PoseProblem::Normal known = seen;
  problem.add_prior(pose, &known);
  const Matrix6d& information = known.information;
  const auto [values, axes] = spectrum(information);
  const bool determined = information.allFinite() && values[0] > 1e-12 * values[5];
  if (estimate.inliers < options.min_inliers || !determined || !pose.translation.allFinite()) return estimate;
  estimate.ok = true;
  estimate.cam_from_world = pose;
  estimate.covariance = axes * values.cwiseInverse().asDiagonal() * axes.transpose();
  if (prior == nullptr) return estimate;
  const Vector6d away = -solve_symmetric(seen.information, seen.gradient);
  if (away.allFinite() && spectrum(seen.information).values[0] > 1e-12 * values[5])
    estimate.by_observations = {solver::perturbed(pose, away), seen.information};
  return estimate;
}

}  // namespace dkb
