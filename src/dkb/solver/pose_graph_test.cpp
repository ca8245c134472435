// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment of poses and motions alone.
#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <array>

#include "dkb/geometry/decompositions.h"
#include "dkb/solver/bundle_adjustment.h"
#include "dkb/util/chi_square.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

Vector6d noise(Random& random, double sigma) {
  Vector6d d;
  for (double& value : d) value = sigma * random.normal();
  return d;
}

// A round trip with odometry edges, some closures, and a start that has drifted.
struct Circle {
  std::vector<Rigid3> truth;
  BaProblem graph;

  Circle(int n, double sigma, uint64_t seed) {
    Random random(seed);
    for (int k = 0; k < n; ++k) {
      const double angle = 2 * M_PI * k / n;
      const Rigid3 world_from_cam(rotation_from_vector({0, -angle, 0}), {3 * std::sin(angle), 0, 3 * std::cos(angle)});
      truth.push_back(world_from_cam.inverse());
    }
    const auto join = [&](int a, int b) {
      PoseEdge e;
      e.a = a, e.b = b;
      e.b_from_a = truth[b] * truth[a].inverse() * rigid3_from_tangent(noise(random, sigma));
      Vector6d weight;
      weight << 1, 2, 3, 4, 5, 6;
      e.information = weight.asDiagonal();
      e.information(0, 4) = e.information(4, 0) = 0.5;
      e.information /= std::max(sigma * sigma, 1e-6);
      graph.motions.push_back(e);
    };
    for (int k = 0; k + 1 < n; ++k) join(k, k + 1);
    for (int k = 0; k + 3 < n; k += 2) join(k + 3, k);  // backward edges too
    join(n - 1, 0);
    join(n - 2, 1);
    graph.cam_from_world = truth;
    for (int k = 1; k < n; ++k) {
      graph.cam_from_world[k] = rigid3_from_tangent(noise(random, 0.005 + sigma)) *
                                (truth[k] * truth[k - 1].inverse()) * graph.cam_from_world[k - 1];
    }
    graph.fixed.assign(n, 0);
    graph.fixed[0] = 1;
  }
};

BaResult optimise(BaProblem& graph) {
  return bundle_adjust(graph, BaOptions::of_pose_graph());
}

double max_difference(const std::vector<Rigid3>& a, const std::vector<Rigid3>& b) {
  double largest = 0;
  for (size_t k = 0; k < a.size(); ++k) {
    const Rigid3 d = a[k] * b[k].inverse();
    largest = std::max({largest, d.translation.norm(), vector_from_rotation(d.rotation).norm()});
  }
  return largest;
}

// The same residual for automatic derivatives; poses as quaternion (x y z w) and translation of cam_from_world.
struct CeresEdge {
  const PoseEdge& edge;
  Matrix6d root;

  template <class T>
  bool operator()(const T* a, const T* b, T* residual) const {
    using Q = Eigen::Quaternion<T>;
    using V = Eigen::Matrix<T, 3, 1>;
    const Q qa(a), qb(b);
    const V ta(a[4], a[5], a[6]), tb(b[4], b[5], b[6]);
    const Q b_from_a = qb * qa.conjugate();
    const V t = tb - b_from_a * ta;
    const Q inverse = edge.b_from_a.rotation.cast<T>().conjugate();
    Q q = inverse * b_from_a;
    const V error = inverse * V(t - edge.b_from_a.translation.cast<T>());
    if (q.w() < T(0)) q.coeffs() = -q.coeffs();
    const T n = sqrt(q.vec().squaredNorm() + T(1e-30));
    Eigen::Matrix<T, 6, 1> d;
    d << error, q.vec() * (T(2) * atan2(n, q.w()) / n);
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residual);
    out = root.cast<T>() * d;
    return true;
  }
};

double ceres_pose_graph(BaProblem& graph) {
  std::vector<std::array<double, 7>> poses(graph.cam_from_world.size());
  ceres::Problem problem;
  auto* manifold = new ceres::ProductManifold<ceres::EigenQuaternionManifold, ceres::EuclideanManifold<3>>();
  for (size_t k = 0; k < poses.size(); ++k) {
    Eigen::Map<Eigen::Vector4d>(poses[k].data()) = graph.cam_from_world[k].rotation.coeffs();
    std::copy_n(graph.cam_from_world[k].translation.data(), 3, poses[k].data() + 4);
    problem.AddParameterBlock(poses[k].data(), 7, manifold);
    if (graph.fixed[k]) problem.SetParameterBlockConstant(poses[k].data());
  }
  for (const PoseEdge& e : graph.motions) {
    const Matrix6d root = cholesky_root(e.information).transpose();
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<CeresEdge, 6, 7, 7>(new CeresEdge{e, root}),
                             std::isfinite(e.huber_chi2) ? new ceres::HuberLoss(std::sqrt(e.huber_chi2)) : nullptr,
                             poses[e.a].data(), poses[e.b].data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = 100;
  options.function_tolerance = 1e-14;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (size_t k = 0; k < poses.size(); ++k) {
    graph.cam_from_world[k] = {Eigen::Quaterniond(poses[k].data()),
                               Eigen::Vector3d(poses[k][4], poses[k][5], poses[k][6])};
  }
  return 2 * summary.final_cost;
}

TEST(PoseGraph, ClosesTheLoopExactlyWithoutNoise) {
  Circle circle(100, 0, 1);
  const BaResult result = optimise(circle.graph);
  EXPECT_LT(result.final_cost, 1e-6 * result.initial_cost);
  EXPECT_LT(max_difference(circle.graph.cam_from_world, circle.truth), 1e-5);
}

TEST(PoseGraph, ReachesTheMinimumThatCeresReaches) {
  for (const bool robust : {false, true}) {
    Circle circle(80, 0.01, 2);
    if (robust) {
      for (PoseEdge& e : circle.graph.motions)
        if (std::abs(e.a - e.b) > 3) e.huber_chi2 = kChi2SixDof99;
      PoseEdge wrong = circle.graph.motions.back();
      wrong.a = 20, wrong.b = 60, wrong.huber_chi2 = kChi2SixDof99;
      circle.graph.motions.push_back(wrong);
    }
    BaProblem theirs = circle.graph;
    BaOptions options = BaOptions::of_pose_graph();
    options.rounds = {100};
    options.relative_tolerance = 1e-13;
    const BaResult result = bundle_adjust(circle.graph, options);
    const double cost = ceres_pose_graph(theirs);
    EXPECT_NEAR(result.final_cost, cost, 1e-6 * cost) << robust;
    EXPECT_LT(max_difference(circle.graph.cam_from_world, theirs.cam_from_world), 1e-4) << robust;
  }
}

TEST(PoseGraph, AWrongRobustEdgeBendsLittle) {
  Circle circle(80, 0.002, 3);
  PoseEdge wrong = circle.graph.motions.back();
  wrong.a = 20, wrong.b = 60;
  BaProblem plain = circle.graph, robust = circle.graph;
  plain.motions.push_back(wrong);
  wrong.huber_chi2 = kChi2SixDof99;
  robust.motions.push_back(wrong);
  BaOptions options = BaOptions::of_pose_graph();
  options.rounds = {100};
  bundle_adjust(plain, options);
  bundle_adjust(robust, options);
  EXPECT_LT(max_difference(robust.cam_from_world, circle.truth),
            0.2 * max_difference(plain.cam_from_world, circle.truth));
}

TEST(PoseGraph, DegenerateGraphsStayFinite) {
  BaProblem empty;
  EXPECT_EQ(optimise(empty).final_cost, 0);
  Circle circle(10, 0.01, 1);
  BaProblem free = circle.graph;
  free.fixed.assign(10, 0);  // nothing holds it
  free.cam_from_world.push_back(Rigid3());
  free.fixed.push_back(0);  // and one pose without edges
  const BaResult result = optimise(free);
  EXPECT_LE(result.final_cost, result.initial_cost);
  for (const Rigid3& pose : free.cam_from_world) {
    EXPECT_TRUE(pose.translation.allFinite() && pose.rotation.coeffs().allFinite());
  }
  BaProblem held = circle.graph;
  held.fixed.assign(10, 1);
  const BaResult unmoved = optimise(held);
  EXPECT_EQ(unmoved.final_cost, unmoved.initial_cost);
}

TEST(PoseGraph, TheSameInputGivesTheSameBits) {
  Circle a(60, 0.01, 5), b(60, 0.01, 5);
  optimise(a.graph);
  optimise(b.graph);
  for (size_t k = 0; k < a.truth.size(); ++k) {
    EXPECT_EQ(a.graph.cam_from_world[k].translation, b.graph.cam_from_world[k].translation);
    EXPECT_EQ(a.graph.cam_from_world[k].rotation.coeffs(), b.graph.cam_from_world[k].rotation.coeffs());
  }
}

TEST(PoseGraph, RefusesEdgesThatDoNotFit) {
  Circle circle(5, 0.01, 1);
  circle.graph.motions[0].a = 5;
  EXPECT_THROW(optimise(circle.graph), InputError);
  circle.graph.motions[0].a = circle.graph.motions[0].b;
  EXPECT_THROW(optimise(circle.graph), InputError);
}

}  // namespace
}  // namespace dkb
