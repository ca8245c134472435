// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <algorithm>
#include <array>
#include <vector>

#include "dkb/geometry/decompositions.h"
#include "dkb/solver/bundle_adjustment.h"

namespace dkb {

// The same bundle adjustment written plainly with Ceres: automatic derivatives, Huber loss. Oracle of the tests and
// yardstick of the benchmark.
struct CeresPixelDepth {
  const CameraModel& camera;
  const BaObservation& o;

  template <class T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    T p[3];
    ceres::AngleAxisRotatePoint(pose, point, p);
    for (int k = 0; k < 3; ++k) p[k] += pose[3 + k];
    residual[0] = (camera.fx * p[0] / p[2] + camera.cx - o.u) * o.inv_sigma;
    residual[1] = (camera.fy * p[1] / p[2] + camera.cy - o.v) * o.inv_sigma;
    residual[2] = (p[2] - o.depth) * o.inv_depth_sigma;
    return true;
  }
};

struct CeresPixel {
  CeresPixelDepth full;

  template <class T>
  bool operator()(const T* pose, const T* point, T* residual) const {
    T all[3];
    full(pose, point, all);
    residual[0] = all[0];
    residual[1] = all[1];
    return true;
  }
};

struct CeresMotion {
  const PoseEdge& edge;

  template <class T>
  bool operator()(const T* a, const T* b, T* residual) const {
    // a_from_b of the edge, composed with b_from_a of the poses, is T(d) in the axes of a.
    T of_a[4], of_b[4], a_inverse[4], turn[4], moved[3], error_turn[4];
    ceres::AngleAxisToQuaternion(a, of_a);
    ceres::AngleAxisToQuaternion(b, of_b);
    a_inverse[0] = of_a[0];
    for (int k = 1; k < 4; ++k) a_inverse[k] = -of_a[k];
    ceres::QuaternionProduct(of_b, a_inverse, turn);
    ceres::QuaternionRotatePoint(turn, a + 3, moved);
    const Rigid3 inverse = edge.b_from_a.inverse();
    const T from_edge[4] = {T(inverse.rotation.w()), T(inverse.rotation.x()), T(inverse.rotation.y()),
                            T(inverse.rotation.z())};
    for (int k = 0; k < 3; ++k) moved[k] = b[3 + k] - moved[k];
    T error[6];
    ceres::QuaternionRotatePoint(from_edge, moved, error);
    for (int k = 0; k < 3; ++k) error[k] += T(inverse.translation[k]);
    ceres::QuaternionProduct(from_edge, turn, error_turn);
    ceres::QuaternionToAngleAxis(error_turn, error + 3);
    const Matrix6d root = cholesky_root(edge.information).transpose();
    for (int i = 0; i < 6; ++i) {
      residual[i] = T(0);
      for (int k = i; k < 6; ++k) residual[i] += root(i, k) * error[k];
    }
    return true;
  }
};

// Student's t with four degrees of freedom in the plane about a variance: slope 6 / (4 + s / v).
class CeresStudent : public ceres::LossFunction {
 public:
  explicit CeresStudent(double variance) : variance_(variance) {}
  void Evaluate(double s, double rho[3]) const override {
    const double sum = 4 + s / variance_;
    rho[0] = 6 * variance_ * std::log(sum / 4);
    rho[1] = 6 / sum;
    rho[2] = -6 / (variance_ * sum * sum);
  }

 private:
  double variance_;
};

struct CeresBa {
  double final_cost = 0;  // in the convention of BaResult
  int iterations = 0;
  double solve_ms = 0;  // without building the problem
};

struct CeresBaOptions {
  int iterations = 50;
  double relative_tolerance = 1e-12;
  bool robust = true;
  bool fixed_points = false;
  double student_variance = 0;  // above 0: CeresStudent's in the place of Huber's
  double chi2_pixel = kChi2TwoDof95, chi2_depth = kChi2ThreeDof95;
  ceres::LinearSolverType solver = ceres::DENSE_SCHUR;
};

// Refines in place all observations that `left_out` does not mark (empty: none). Weights are taken into account where
// an observation has no depth.
inline CeresBa ceres_bundle_adjust(BaProblem& problem, const CeresBaOptions& options,
                                   const std::vector<uint8_t>& left_out = {}) {
  std::vector<std::array<double, 6>> poses(problem.cam_from_world.size());
  for (size_t c = 0; c < poses.size(); ++c) {
    const Rigid3& pose = problem.cam_from_world[c];
    const double q[4] = {pose.rotation.w(), pose.rotation.x(), pose.rotation.y(), pose.rotation.z()};
    ceres::QuaternionToAngleAxis(q, poses[c].data());
    std::copy_n(pose.translation.data(), 3, poses[c].data() + 3);
  }
  ceres::Problem::Options problem_options;
  ceres::Problem ceres_problem(problem_options);
  auto* ordering = new ceres::ParameterBlockOrdering;
  for (size_t i = 0; i < problem.observations.size(); ++i) {
    if (!left_out.empty() && left_out[i]) continue;
    const BaObservation& o = problem.observations[i];
    const bool depth = o.depth > 0;
    const CeresPixelDepth functor{problem.camera, o};
    ceres::CostFunction* cost =
        depth ? static_cast<ceres::CostFunction*>(
                    new ceres::AutoDiffCostFunction<CeresPixelDepth, 3, 6, 3>(new CeresPixelDepth(functor)))
              : new ceres::AutoDiffCostFunction<CeresPixel, 2, 6, 3>(new CeresPixel{functor});
    ceres::LossFunction* loss = nullptr;
    if (options.robust && options.student_variance > 0)
      loss = new CeresStudent(options.student_variance);
    else if (options.robust)
      loss = new ceres::HuberLoss(std::sqrt(depth ? options.chi2_depth : options.chi2_pixel));
    if (!depth && o.weight != 1) loss = new ceres::ScaledLoss(loss, o.weight, ceres::TAKE_OWNERSHIP);
    ceres_problem.AddResidualBlock(cost, loss, poses[o.camera].data(), problem.points[o.point].data());
    ordering->AddElementToGroup(problem.points[o.point].data(), 0);
    ordering->AddElementToGroup(poses[o.camera].data(), 1);
  }
  for (const PoseEdge& e : problem.motions) {
    ceres_problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<CeresMotion, 6, 6, 6>(new CeresMotion{e}),
        std::isfinite(e.huber_chi2) && options.robust ? new ceres::HuberLoss(std::sqrt(e.huber_chi2)) : nullptr,
        poses[e.a].data(), poses[e.b].data());
    ordering->AddElementToGroup(poses[e.a].data(), 1);
    ordering->AddElementToGroup(poses[e.b].data(), 1);
  }
  for (size_t c = 0; c < poses.size(); ++c) {
    if (problem.fixed[c] && ceres_problem.HasParameterBlock(poses[c].data())) {
      ceres_problem.SetParameterBlockConstant(poses[c].data());
    }
  }
  if (options.fixed_points) {
    for (Eigen::Vector3d& point : problem.points) {
      if (ceres_problem.HasParameterBlock(point.data())) ceres_problem.SetParameterBlockConstant(point.data());
    }
  }
  ceres::Solver::Options solver;
  solver.linear_solver_type = options.solver;
  // Not CHOLMOD: it hands work to whichever BLAS is installed, and some of those start threads of their own, in which
  // the thread sanitizer sees races.
  solver.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  solver.linear_solver_ordering.reset(ordering);
  solver.max_num_iterations = options.iterations;
  solver.function_tolerance = options.relative_tolerance;
  solver.gradient_tolerance = 1e-14;
  solver.parameter_tolerance = 1e-14;
  solver.num_threads = 1;
  solver.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solver, &ceres_problem, &summary);
  for (size_t c = 0; c < poses.size(); ++c) {
    if (problem.fixed[c]) continue;
    double q[4];
    ceres::AngleAxisToQuaternion(poses[c].data(), q);
    problem.cam_from_world[c] = {Eigen::Quaterniond(q[0], q[1], q[2], q[3]),
                                 Eigen::Vector3d(poses[c][3], poses[c][4], poses[c][5])};
  }
  return {2 * summary.final_cost, static_cast<int>(summary.iterations.size()) - 1, 1e3 * summary.total_time_in_seconds};
}

}  // namespace dkb
