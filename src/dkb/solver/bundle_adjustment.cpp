// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/bundle_adjustment.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "dkb/geometry/decompositions.h"
#include "dkb/solver/ba_layout.h"
#include "dkb/solver/nielsen_damping.h"
#include "dkb/solver/pose_optimiser.h"
#include "dkb/solver/relative_pose.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

using solver::kBlockSize;
using solver::kPairStride;
using solver::kPointStride;

// Poses, and points as x y z 0 with an extra one at the end for the filling of the layout.
struct State {
  std::vector<Rigid3> poses;
  std::vector<double> points;
};

class BundleAdjuster {
 public:
  BundleAdjuster(BaProblem& problem, const BaOptions& options)
      : problem_(problem), options_(options), layout_(problem), cholesky_(layout_.pattern, kernels_) {
    const size_t entries = layout_.observation_of_entry.size();
    values_.assign(entries * kArrays, 0.0);
    for (size_t e = 0; e < entries; ++e) {
      if (layout_.observation_of_entry[e] < 0) continue;
      const BaObservation& o = problem.observations[layout_.observation_of_entry[e]];
      array(kU)[e] = o.u;
      array(kV)[e] = o.v;
      array(kInvSigma)[e] = o.inv_sigma;
      array(kDepth)[e] = o.depth;
      array(kInvDepthSigma)[e] = o.depth > 0 ? o.inv_depth_sigma : 0.0;
    }
    state_.poses = problem.cam_from_world;
    state_.points.assign(4 * (problem.points.size() + 1), 0.0);
    for (size_t p = 0; p < problem.points.size(); ++p) {
      std::copy_n(problem.points[p].data(), 3, state_.points.data() + 4 * p);
    }
    const size_t n = layout_.free_cameras();
    point_sums_.resize(static_cast<size_t>(kPointStride) * (layout_.points + 1));
    factors_.resize(point_sums_.size());
    pair_sums_.resize(static_cast<size_t>(kPairStride) * (layout_.pairs() + 1));
    system_.resize(kBlockSize * layout_.pattern.rows.size());
    camera_sums_.resize(kBlockSize * n);
    camera_gradient_.resize(6 * n);
    diagonal_.resize(6 * n);
    camera_step_.resize(6 * n);
    point_step_.resize(state_.points.size());
  }

  BaResult run() {
    BaResult result;
    result.outlier.assign(problem_.observations.size(), 0);
    judge(result);
    // Beyond the limit an observation may still pull, softened by the kernel; behind the camera it has no residual.
    use(result, options_.prefilter);
    for (size_t round = 0; round < options_.rounds.size(); ++round) {
      const double start = cost(state_);
      if (round == 0) result.initial_cost = start;
      result.final_cost = descend(start, options_.rounds[round], result.iterations);
      judge(result);
      use(result, true);
      layout_.motions->judge(state_.poses);
    }
    problem_.cam_from_world = state_.poses;
    for (size_t p = 0; p < problem_.points.size(); ++p) {
      std::copy_n(state_.points.data() + 4 * p, 3, problem_.points[p].data());
    }
    if (problem_.asked >= 0) result.covariance = covariance(layout_.free_of_camera[problem_.asked]);
    return result;
  }

 private:
  enum Array { kU, kV, kInvSigma, kDepth, kInvDepthSigma, kUsedInvDepthSigma, kUsedWeight, kChi2, kArrays };
  double* array(Array a) { return values_.data() + layout_.observation_of_entry.size() * a; }

  solver::BaCameraInput input(int camera, const State& state) {
    const Rigid3& pose = state.poses[camera];
    const CameraModel& model = problem_.camera;
    solver::BaCameraInput in{};
    in.camera = {model.fx, model.fy, model.cx, model.cy, {}, {}, kDepthInFront};
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(in.camera.rotation) = pose.matrix3();
    Eigen::Map<Eigen::Vector3d>(in.camera.translation) = pose.translation;
    in.observations = {array(kU),         array(kV), array(kInvSigma), array(kDepth), array(kUsedInvDepthSigma),
                       array(kUsedWeight)};
    in.point = layout_.point_of_entry.data();
    in.pair = layout_.pair_of_entry.data();
    in.points = state.points.data();
    in.begin = layout_.camera_first[camera];
    in.end = layout_.camera_first[camera + 1];
    in.limits = {true, options_.chi2_pixel, options_.chi2_depth};
    return in;
  }

  // Marks all observations by their unweighted error at the present state.
  void judge(BaResult& result) {
    for (int c = 0; c < layout_.cameras; ++c) {
      solver::BaCameraInput in = input(c, state_);
      in.observations.inv_depth_sigma = array(kInvDepthSigma);
      kernels_.ba_chi2(in, array(kChi2));
    }
    for (size_t e = 0; e < layout_.observation_of_entry.size(); ++e) {
      const int o = layout_.observation_of_entry[e];
      if (o < 0) continue;
      const double limit = array(kInvDepthSigma)[e] > 0 ? options_.chi2_depth : options_.chi2_pixel;
      result.outlier[o] = !(array(kChi2)[e] <= limit);
    }
  }

  // What takes part from now on: observations in front of their cameras, and no outliers if asked.
  void use(const BaResult& result, bool without_outliers) {
    for (size_t e = 0; e < layout_.observation_of_entry.size(); ++e) {
      const int o = layout_.observation_of_entry[e];
      if (o < 0) continue;
      const bool used = std::isfinite(array(kChi2)[e]) && !(without_outliers && result.outlier[o]);
      array(kUsedWeight)[e] = used ? problem_.observations[o].weight : 0.0;
      array(kUsedInvDepthSigma)[e] = used ? array(kInvDepthSigma)[e] : 0.0;
    }
  }

  double cost(const State& state) {
    double total = layout_.motions->cost(state.poses);
    for (int c = 0; c < layout_.cameras; ++c) total += kernels_.ba_cost(input(c, state));
    return total;
  }

  void linearise() {
    std::fill(point_sums_.begin(), point_sums_.end(), 0.0);
    double sums[solver::kPoseSums];
    for (int c = 0; c < layout_.cameras; ++c) {
      const int free = layout_.free_of_camera[c];
      kernels_.ba_linearise(input(c, state_), free < 0, point_sums_.data(), pair_sums_.data(), sums);
      if (free < 0) continue;
      Eigen::Map<Matrix6d> block(camera_sums_.data() + kBlockSize * static_cast<size_t>(free));
      const double* h = sums;
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) block(i, j) = block(j, i) = *h++;
      }
      std::copy_n(h, 6, camera_gradient_.data() + 6 * free);
    }
  }

  // Step of all cameras and points for a damping, and the cost that the quadratic model saves. False: not solvable.
  bool solve(double damping, double& predicted) {
    const auto diagonal_block = [this](int free) {
      return system_.data() + kBlockSize * static_cast<size_t>(layout_.pattern.first[free]);
    };
    std::fill(system_.begin(), system_.end(), 0.0);
    for (int i = 0; i < layout_.free_cameras(); ++i)
      std::copy_n(camera_sums_.data() + kBlockSize * static_cast<size_t>(i), kBlockSize, diagonal_block(i));
    gradient_ = camera_gradient_;
    layout_.motions->add(state_.poses, system_, gradient_);
    for (int i = 0; i < layout_.free_cameras(); ++i)
      for (int k = 0; k < 6; ++k) {
        double& diagonal = diagonal_block(i)[7 * k];
        diagonal_[6 * static_cast<size_t>(i) + static_cast<size_t>(k)] = std::max(diagonal, kMinDiagonal);
        diagonal += damping * std::max(diagonal, kMinDiagonal);
      }
    camera_step_ = gradient_;
    const solver::SchurInput in{layout_.points,
                                layout_.pair_first.data(),
                                layout_.pair_camera.data(),
                                layout_.block.data(),
                                layout_.block_first.data(),
                                point_sums_.data(),
                                pair_sums_.data(),
                                damping};
    kernels_.schur(in, system_.data(), camera_step_.data(), factors_.data());
    if (!cholesky_.factorise(system_)) return false;
    cholesky_.solve(camera_step_);
    predicted = 0;
    for (int i = 0; i < layout_.free_cameras(); ++i) {
      for (int k = 0; k < 6; ++k) {
        double& d = camera_step_[6 * i + k];
        d = -d;
        predicted += damping * diagonal_[6 * i + k] * d * d - gradient_[6 * i + k] * d;
      }
    }
    for (int p = 0; p < layout_.points; ++p) predicted += solve_point(p, damping);
    return std::isfinite(predicted);
  }

  // Point step from the cameras' steps: -L^-T (L^-1 g + L^-1 W^T d). Returns its part of the predicted saving.
  double solve_point(int point, double damping) {
    const double* f = factors_.data() + static_cast<size_t>(kPointStride) * point;
    const double* v = point_sums_.data() + static_cast<size_t>(kPointStride) * point;
    double* step = point_step_.data() + 4 * static_cast<size_t>(point);
    step[0] = step[1] = step[2] = 0;
    if (f[0] == 0) return 0;
    double t0 = 0, t1 = 0, t2 = 0;
    for (int pair = layout_.pair_first[point]; pair < layout_.pair_first[point + 1]; ++pair) {
      const double* w = pair_sums_.data() + static_cast<size_t>(kPairStride) * pair;
      const double* d = camera_step_.data() + 6 * static_cast<size_t>(layout_.pair_camera[pair]);
      for (int k = 0; k < 6; ++k) {
        t0 += w[k] * d[k];
        t1 += w[6 + k] * d[k];
        t2 += w[12 + k] * d[k];
      }
    }
    const double y0 = t0 * f[0], y1 = (t1 - f[1] * y0) * f[3], y2 = (t2 - f[2] * y0 - f[4] * y1) * f[5];
    const double r0 = f[6] + y0, r1 = f[7] + y1, r2 = f[8] + y2;
    step[2] = -(r2 * f[5]);
    step[1] = -(r1 + f[4] * step[2]) * f[3];
    step[0] = -(r0 + f[1] * step[1] + f[2] * step[2]) * f[0];
    const double damp = damping * (v[0] + v[3] + v[5]);
    double saved = 0;
    for (int k = 0; k < 3; ++k) saved += damp * step[k] * step[k] - v[6 + k] * step[k];
    return saved;
  }

  // f H^-1: H are the normal equations, and f is how much farther apart the pulls of the image's parts move the camera
  // than their claim has it. What is off in one part is off together, in all keyframes that see it. Motions count as
  // they claim, and the claim of all as one part more.
  std::optional<Matrix6d> covariance(int free) {
    if (free < 0) return std::nullopt;
    linearise();
    double unused = 0;
    if (!solve(kNoDamping, unused)) return std::nullopt;
    solver::PoseColumns columns(static_cast<Eigen::Index>(gradient_.size()), 6);  // of H^-1
    std::vector<double> column(gradient_.size());
    for (int k = 0; k < 6; ++k) {
      std::fill(column.begin(), column.end(), 0.0);
      column[static_cast<size_t>(6 * free + k)] = 1;
      cholesky_.solve(column);
      columns.col(k) = Eigen::Map<const Eigen::VectorXd>(column.data(), columns.rows());
    }
    if (!columns.allFinite()) return std::nullopt;
    const Matrix6d own = columns.middleRows<6>(6 * free);
    const Matrix6d claimed = 0.5 * (own + own.transpose());

    const std::vector<Vector6d> pulls = pulls_of_pairs();
    std::map<std::pair<int, int>, Vector6d> parts;
    for (int p = 0; p < layout_.points; ++p) {
      Vector6d moves = Vector6d::Zero();
      for (int pair = layout_.pair_first[p]; pair < layout_.pair_first[p + 1]; ++pair)
        moves += columns.middleRows<6>(6 * layout_.pair_camera[pair]).transpose() * pulls[static_cast<size_t>(pair)];
      parts.try_emplace(part_of(p, layout_.camera_of_free[free]), Vector6d::Zero()).first->second += moves;
    }
    Matrix6d scatter = layout_.motions->propagated(state_.poses, columns);
    for (const auto& [part, moves] : parts) scatter += moves * moves.transpose();
    const double n = static_cast<double>(parts.size()), factor = (inverse(claimed) * scatter).trace() / 6;
    if (!std::isfinite(factor)) return std::nullopt;
    return (n * factor + 1) / (n + 1) * claimed;
  }

  // By place in the image of a camera.
  std::pair<int, int> part_of(int point, int camera) const {
    const CameraModel& model = problem_.camera;
    const double size = model.width / kPartsAcross;
    const Eigen::Vector3d at =
        state_.poses[camera] * Eigen::Map<const Eigen::Vector3d>(state_.points.data() + 4 * static_cast<size_t>(point));
    const double z = std::max(std::abs(at.z()), kDepthInFront);
    const auto cell = [&](double f, double x) {
      return static_cast<int>(std::floor(std::clamp(f * x / z / size, -1e6, 1e6)));
    };
    return {cell(model.fx, at.x()), cell(model.fy, at.y())};
  }

  // Of each pair of a point and a free camera: the gradient by the camera, with the point eliminated.
  std::vector<Vector6d> pulls_of_pairs() {
    std::vector<Vector6d> pulls(static_cast<size_t>(layout_.pairs()) + 1, Vector6d::Zero());
    const CameraModel& model = problem_.camera;
    for (int c = 0; c < layout_.cameras; ++c) {
      if (layout_.free_of_camera[c] < 0) continue;
      for (int e = layout_.camera_first[c]; e < layout_.camera_first[c + 1]; ++e) {
        const double weight = array(kUsedWeight)[e], depth_weight = array(kUsedInvDepthSigma)[e];
        if (weight == 0) continue;
        const double* point = state_.points.data() + 4 * static_cast<size_t>(layout_.point_of_entry[e]);
        const Eigen::Vector3d at = state_.poses[c] * Eigen::Map<const Eigen::Vector3d>(point);
        const Eigen::Vector2d off = model.project(at) - Eigen::Vector2d(array(kU)[e], array(kV)[e]);
        const double information = weight * array(kInvSigma)[e] * array(kInvSigma)[e] / at.z();
        const double by_x = information * model.fx * off.x(), by_y = information * model.fy * off.y();
        const double by_z = depth_weight * depth_weight * (at.z() - array(kDepth)[e]);
        const Eigen::Vector3d pull(by_x, by_y, by_z - (at.x() * by_x + at.y() * by_y) / at.z());
        Vector6d& sum = pulls[static_cast<size_t>(layout_.pair_of_entry[e])];
        sum.head<3>() -= pull;
        sum.tail<3>() -= at.cross(pull);
      }
    }
    std::fill(camera_step_.begin(), camera_step_.end(), 0.0);
    for (int p = 0; p < layout_.points; ++p) {
      solve_point(p, kNoDamping);
      const double* step = point_step_.data() + 4 * static_cast<size_t>(p);
      for (int pair = layout_.pair_first[p]; pair < layout_.pair_first[p + 1]; ++pair) {
        const double* w = pair_sums_.data() + static_cast<size_t>(kPairStride) * pair;
        for (int k = 0; k < 6; ++k)
          pulls[static_cast<size_t>(pair)][k] += w[k] * step[0] + w[6 + k] * step[1] + w[12 + k] * step[2];
      }
    }
    return pulls;
  }

  double descend(double present, int iterations, int& total) {
    solver::NielsenDamping damping(options_.initial_damping, 1e-10);
    bool fresh = false;
    for (int i = 0; i < iterations; ++i) {
      ++total;
      if (!fresh) linearise();
      fresh = true;
      double predicted = 0;
      const bool solved = solve(damping.value(), predicted);
      if (solved && predicted <= 1e-3 * options_.relative_tolerance * present) break;
      double next = 0;
      if (solved) {
        candidate_.poses = state_.poses;
        candidate_.points = state_.points;
        for (int f = 0; f < layout_.free_cameras(); ++f) {
          Rigid3& pose = candidate_.poses[layout_.camera_of_free[f]];
          pose = solver::perturbed(pose, Eigen::Map<const Vector6d>(camera_step_.data() + 6 * f));
        }
        for (size_t k = 0; k < 4 * static_cast<size_t>(layout_.points); ++k) candidate_.points[k] += point_step_[k];
        next = cost(candidate_);
      }
      if (solved && next < present) {
        damping.accept(present - next, predicted);
        std::swap(state_, candidate_);
        fresh = false;
        const bool done = present - next <= options_.relative_tolerance * present;
        present = next;
        if (done) break;
      } else if (!damping.reject()) {
        break;
      }
    }
    return present;
  }

  static constexpr double kMinDiagonal = 1e-6;
  static constexpr double kPartsAcross = 16;  // parts of an image in a row (measured, docs/decisions.md)
  static constexpr double kNoDamping = 1e-9;  // leaves what nothing determines solvable

  BaProblem& problem_;
  const BaOptions& options_;
  const solver::SolverKernels& kernels_ = solver::solver_kernels();
  solver::BaLayout layout_;
  solver::BlockCholesky cholesky_;
  State state_, candidate_;
  std::vector<double> values_;  // observations as arrays
  std::vector<double> point_sums_, pair_sums_, factors_;
  // Of the present state, per free camera: what its observations give its block of the system and the gradient.
  std::vector<double> camera_sums_, camera_gradient_;
  // Of one step: the cameras' system in the layout's pattern, damped, with the points eliminated; the gradient; and the
  // diagonal before damping.
  std::vector<double> system_, gradient_, diagonal_;
  std::vector<double> camera_step_, point_step_;
};

}  // namespace

void BaOptions::check() const {
  if (rounds.empty()) throw InvalidOption("rounds", "an empty list", "one number of iterations at least");
  for (const int iterations : rounds) require_option(iterations >= 1, "rounds", iterations, ">= 1");
  require_option(chi2_pixel > 0, "chi2_pixel", chi2_pixel, "> 0");
  require_option(chi2_depth > 0, "chi2_depth", chi2_depth, "> 0");
  require_option(initial_damping > 0, "initial_damping", initial_damping, "> 0");
  require_option(relative_tolerance >= 0, "relative_tolerance", relative_tolerance, ">= 0");
}

BaResult bundle_adjust(BaProblem& problem, const BaOptions& options) {
  options.check();
  return BundleAdjuster(problem, options).run();
}

}  // namespace dkb
