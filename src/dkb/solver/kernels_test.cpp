// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/kernels.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cstring>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/util/random.h"

namespace dkb::solver {
namespace {

// Observations of one camera in all conditions: with and without depth, gross errors, behind the camera, left out.
struct Data {
  explicit Data(uint64_t seed, int entries = 64, bool ordinary = false) : count(entries) {
    Random random(seed);
    for (std::vector<double>* a : {&u, &v, &inv_sigma, &depth, &inv_depth_sigma, &weight, &x, &y, &z}) a->resize(count);
    camera = {520, 515, 320, 240, {}, {}, 0.01};
    pose = Rigid3(rotation_from_vector({0.1, -0.2, 0.05}), {0.1, 0.2, -0.1});
    set_pose(pose);
    for (int i = 0; i < count; ++i) {
      const bool behind = !ordinary && i % 11 == 7;
      const Eigen::Vector3d in_cam{random.uniform(-1, 1), random.uniform(-1, 1),
                                   behind ? -1.0 : random.uniform(0.5, 4)};
      const Eigen::Vector3d world = pose.inverse() * in_cam;
      x[i] = world.x(), y[i] = world.y(), z[i] = world.z();
      const double error = !ordinary && i % 5 == 2 ? 30 : 1;
      u[i] = camera.fx * in_cam.x() / in_cam.z() + camera.cx + error * random.normal();
      v[i] = camera.fy * in_cam.y() / in_cam.z() + camera.cy + error * random.normal();
      inv_sigma[i] = 1 / random.uniform(1, 3);
      weight[i] = !ordinary && i % 13 == 4 ? 0.0 : 0.5 * (1 + i % 4);
      if (i % 3 != 0) {
        depth[i] = in_cam.z() + 0.02 * error * random.normal();
        inv_depth_sigma[i] = weight[i] > 0 ? 50 : 0;
      }
      point.push_back(i % 20);
      pair.push_back(i);
    }
    for (int i = 0; i < std::min(count, 20); ++i) {
      for (const double value : {x[i], y[i], z[i], 0.0}) points.push_back(value);
    }
  }
  void set_pose(const Rigid3& p) {
    Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.rotation) = p.matrix3();
    Eigen::Map<Eigen::Vector3d>(camera.translation) = p.translation;
  }
  ObservationArrays arrays() const {
    return {u.data(), v.data(), inv_sigma.data(), depth.data(), inv_depth_sigma.data(), weight.data()};
  }
  PoseInput pose_input(bool robust) const {
    return {camera, arrays(), x.data(), y.data(), z.data(), count, {robust, 5.991, 7.815}};
  }
  BaCameraInput ba_input(bool robust) const {
    return {camera, arrays(), point.data(), pair.data(), points.data(), 0, count, {robust, 5.991, 7.815}};
  }

  int count;
  CameraPose camera;
  Rigid3 pose;
  std::vector<double> u, v, inv_sigma, depth, inv_depth_sigma, weight, x, y, z, points;
  std::vector<int> point, pair;
};

// Residual of one observation in standard deviations times the root of its weight, written the plain way.
Eigen::Vector3d plain_residual(const Data& d, int i, const Rigid3& pose, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = pose * point;
  const double w = std::sqrt(d.weight[i]);
  return {w * (d.camera.fx * p.x() / p.z() + d.camera.cx - d.u[i]) * d.inv_sigma[i],
          w * (d.camera.fy * p.y() / p.z() + d.camera.cy - d.v[i]) * d.inv_sigma[i],
          (p.z() - d.depth[i]) * d.inv_depth_sigma[i]};
}

struct PlainJacobians {
  Eigen::Matrix<double, 3, 6> pose;
  Eigen::Matrix3d point;
};
PlainJacobians numeric_jacobians(const Data& d, int i, const Eigen::Vector3d& point) {
  const double h = 1e-6;
  PlainJacobians j;
  for (int k = 0; k < 6; ++k) {
    const Vector6d step = h * Vector6d::Unit(k);
    const Rigid3 plus = (d.pose.inverse() * rigid3_from_tangent(step)).inverse();
    const Rigid3 minus = (d.pose.inverse() * rigid3_from_tangent(-step)).inverse();
    j.pose.col(k) = (plain_residual(d, i, plus, point) - plain_residual(d, i, minus, point)) / (2 * h);
  }
  for (int k = 0; k < 3; ++k) {
    const Eigen::Vector3d step = h * Eigen::Vector3d::Unit(k);
    j.point.col(k) =
        (plain_residual(d, i, d.pose, point + step) - plain_residual(d, i, d.pose, point - step)) / (2 * h);
  }
  return j;
}

template <int N>
Eigen::Matrix<double, N, N> symmetric(const double* upper) {
  Eigen::Matrix<double, N, N> m;
  for (int i = 0; i < N; ++i) {
    for (int j = i; j < N; ++j) m(i, j) = m(j, i) = *upper++;
  }
  return m;
}

TEST(SolverKernels, NormalEquationsOfAnObservationEqualNumericJacobians) {
  const Data d(3, 20, true);
  for (int i = 0; i < d.count; ++i) {
    Data one = d;
    for (int k = 0; k < 4; ++k) one.weight[k] = one.inv_depth_sigma[k] = 0;
    for (std::vector<double>* a : {&one.u, &one.v, &one.inv_sigma, &one.depth, &one.inv_depth_sigma, &one.weight}) {
      (*a)[0] = a == &one.u           ? d.u[i]
                : a == &one.v         ? d.v[i]
                : a == &one.depth     ? d.depth[i]
                : a == &one.inv_sigma ? d.inv_sigma[i]
                : a == &one.weight    ? d.weight[i]
                                      : d.inv_depth_sigma[i];
    }
    one.point[0] = i;
    BaCameraInput in = one.ba_input(false);
    in.end = 4;
    std::vector<double> points(kPointStride * 20, 0.0), pairs(kPairStride * 4, 0.0);
    double sums[kPoseSums];
    baseline_kernels().ba_linearise(in, false, points.data(), pairs.data(), sums);

    const Eigen::Vector3d point(d.x[i], d.y[i], d.z[i]);
    const PlainJacobians j = numeric_jacobians(d, i, point);
    const Eigen::Vector3d e = plain_residual(d, i, d.pose, point);
    const double scale = 1e-6 * (j.pose.squaredNorm() + j.point.squaredNorm());
    const auto near = [&](const auto& a, const auto& b) { return (a - b).cwiseAbs().maxCoeff() < scale; };
    EXPECT_TRUE(near(symmetric<6>(sums), Matrix6d(j.pose.transpose() * j.pose))) << i;
    EXPECT_TRUE(near(Vector6d(sums + 21), Vector6d(j.pose.transpose() * e))) << i;
    EXPECT_TRUE(near(symmetric<3>(points.data() + kPointStride * i), Eigen::Matrix3d(j.point.transpose() * j.point)))
        << i;
    EXPECT_TRUE(near(Eigen::Vector3d(points.data() + kPointStride * i + 6), Eigen::Vector3d(j.point.transpose() * e)))
        << i;
    const Eigen::Matrix<double, 6, 3> w = j.pose.transpose() * j.point;
    EXPECT_TRUE(near((Eigen::Matrix<double, 6, 3>(pairs.data())), w)) << i;
    EXPECT_NEAR(sums[kPoseCost], e.squaredNorm(), 1e-9 * (1 + e.squaredNorm()));
  }
}

// The robust cost with weights, with and without depth, inside and beyond the corner: twice the sums' gradient.
TEST(SolverKernels, RobustGradientIsTheDerivativeOfTheCost) {
  for (int i = 0; i < 64; ++i) {
    Data d(5);
    if (i % 11 == 7) continue;  // behind: constant
    for (int k = 0; k < d.count; ++k) {
      if (k != i) d.weight[k] = d.inv_depth_sigma[k] = 0;
    }
    double sums[kPoseSums], plus[kPoseSums], minus[kPoseSums];
    baseline_kernels().pose_sums(d.pose_input(true), sums);
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = 1e-6 * Vector6d::Unit(k);
      d.set_pose((d.pose.inverse() * rigid3_from_tangent(step)).inverse());
      baseline_kernels().pose_sums(d.pose_input(true), plus);
      d.set_pose((d.pose.inverse() * rigid3_from_tangent(-step)).inverse());
      baseline_kernels().pose_sums(d.pose_input(true), minus);
      const double numeric = (plus[kPoseCost] - minus[kPoseCost]) / 2e-6;
      EXPECT_NEAR(numeric, 2 * sums[21 + k], 1e-4 * (1 + std::abs(numeric))) << i << " " << k;
    }
  }
}

TEST(SolverKernels, HuberCostIsLinearInTheErrorBeyondTheCorner) {
  Data d(1, 4, true);
  d.inv_depth_sigma.assign(4, 0.0);
  d.weight = {1.5, 0, 0, 0};
  d.inv_sigma[0] = 1;
  const Eigen::Vector3d p = d.pose * Eigen::Vector3d(d.x[0], d.y[0], d.z[0]);
  d.u[0] = d.camera.fx * p.x() / p.z() + d.camera.cx - 10;  // error (10, 0): s = 100
  d.v[0] = d.camera.fy * p.y() / p.z() + d.camera.cy;
  double sums[kPoseSums], chi2[4];
  baseline_kernels().pose_sums(d.pose_input(true), sums);
  EXPECT_NEAR(sums[kPoseCost], 1.5 * (2 * std::sqrt(5.991) * 10 - 5.991), 1e-9);
  baseline_kernels().pose_chi2(d.pose_input(true), chi2);
  EXPECT_NEAR(chi2[0], 100, 1e-9);
}

TEST(SolverKernels, WhatAnObservationCostsDoesNotDependOnItsNeighbours) {
  // Observation 0 is within the corner of pixel and depth together but beyond the one of pixels alone; observation 1
  // is beyond both.
  const auto cost = [](double weight_0, double weight_1) {
    Data d(1, 4, true);
    d.weight = {weight_0, weight_1, 0, 0};
    d.inv_depth_sigma.assign(4, 0.0);
    for (int i = 0; i < 2; ++i) {
      d.inv_sigma[i] = 1;
      const Eigen::Vector3d p = d.pose * Eigen::Vector3d(d.x[i], d.y[i], d.z[i]);
      d.u[i] = d.camera.fx * p.x() / p.z() + d.camera.cx - (i == 0 ? std::sqrt(7.0) : 20.0);
      d.v[i] = d.camera.fy * p.y() / p.z() + d.camera.cy;
      d.depth[i] = p.z() - std::sqrt(0.5) / 50;
      if (d.weight[i] > 0) d.inv_depth_sigma[i] = 50;
    }
    double sums[kPoseSums];
    baseline_kernels().pose_sums(d.pose_input(true), sums);
    return sums[kPoseCost];
  };
  EXPECT_NEAR(cost(1.5, 1) - cost(0, 1), cost(1.5, 0), 1e-9);
  // The common part 7 + 0.5 is whole; half of the pixel part is beyond its corner.
  EXPECT_NEAR(cost(1.5, 0), 7.5 + 0.5 * (2 * std::sqrt(5.991 * 7) - 5.991), 1e-9);
  EXPECT_NEAR(cost(0.5, 1) - cost(0, 1), cost(0.5, 0), 1e-9);
}

TEST(SolverKernels, TheFastestEqualsTheBaselineBitForBit) {
  const SolverKernels &slow = baseline_kernels(), &fast = solver_kernels();
  const auto equal = [](const std::vector<double>& a, const std::vector<double>& b) {
    return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(double)) == 0;
  };
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    for (const bool robust : {false, true}) {
      const Data d(seed);
      std::vector<double> results[2][6];
      const SolverKernels* tables[2] = {&slow, &fast};
      for (int t = 0; t < 2; ++t) {
        const SolverKernels& kernels = *tables[t];
        std::vector<double>* r = results[t];
        r[0].resize(kPoseSums);
        kernels.pose_sums(d.pose_input(robust), r[0].data());
        r[1].resize(d.count);
        kernels.pose_chi2(d.pose_input(robust), r[1].data());
        r[2].assign(kPointStride * 20, 0.0);
        r[3].assign(kPairStride * d.count, 0.0);
        r[4].resize(kPoseSums);
        kernels.ba_linearise(d.ba_input(robust), false, r[2].data(), r[3].data(), r[4].data());
        r[5].push_back(kernels.ba_cost(d.ba_input(robust)));
        r[5].resize(1 + d.count);
        kernels.ba_chi2(d.ba_input(robust), r[5].data() + 1);
      }
      for (int k = 0; k < 6; ++k) EXPECT_TRUE(equal(results[0][k], results[1][k])) << seed << " " << robust << " " << k;
    }
  }
}

// 70 cameras of one point need more than one round of the elimination's scratch space.
TEST(SolverKernels, EliminationEqualsTheDenseSchurComplement) {
  for (const int cameras : {5, 70, 130}) {
    Random random(9);
    const int n = 6 * cameras;
    const auto fill = [&](int rows, int columns) {
      Eigen::MatrixXd m(rows, columns);
      for (int i = 0; i < rows; ++i) {
        for (int j = 0; j < columns; ++j) m(i, j) = random.uniform(-1, 1);
      }
      return m;
    };
    const Eigen::MatrixXd root = fill(3, 3), w = fill(n, 3), g = fill(3, 1);
    const Eigen::Matrix3d v = root * root.transpose() + Eigen::Matrix3d::Identity();
    const double point[kPointStride] = {v(0, 0), v(0, 1), v(0, 2), v(1, 1), v(1, 2), v(2, 2), g(0), g(1), g(2)};
    std::vector<double> pairs(kPairStride * cameras, 0.0);
    std::vector<int> pair_camera, block;
    for (int c = 0; c < cameras; ++c) {
      pair_camera.push_back(c);
      for (int k = 0; k < 18; ++k) pairs[kPairStride * c + k] = w(6 * c + k % 6, k / 6);
    }
    const int blocks = cameras * (cameras + 1) / 2;
    for (int k = 0; k < blocks; ++k) block.push_back(k);
    const int pair_first[2] = {0, cameras};
    const long long block_first[2] = {0, blocks};
    const double damping = 0.1;
    const SchurInput in{1, pair_first, pair_camera.data(), block.data(), block_first, point, pairs.data(), damping};

    const Eigen::Matrix3d damped = v + damping * v.trace() * Eigen::Matrix3d::Identity();
    const Eigen::MatrixXd expected = -w * damped.inverse() * w.transpose();
    const Eigen::VectorXd expected_gradient = -w * damped.inverse() * g;
    std::vector<double> results[2];
    for (int t = 0; t < 2; ++t) {
      std::vector<double> s(kBlockSize * blocks, 0.0), gradient(n, 0.0), factors(kPointStride);
      (t == 0 ? baseline_kernels() : solver_kernels()).schur(in, s.data(), gradient.data(), factors.data());
      int k = 0;
      for (int a = 0; a < cameras; ++a) {
        for (int b = a; b < cameras; ++b, ++k) {
          // Block of the lower triangle (row b, column a), column by column.
          const Eigen::Map<const Matrix6d> made(s.data() + kBlockSize * k);
          ASSERT_LT((made - expected.block<6, 6>(6 * b, 6 * a)).cwiseAbs().maxCoeff(), 1e-12) << a << " " << b;
        }
      }
      EXPECT_LT((Eigen::Map<Eigen::VectorXd>(gradient.data(), n) - expected_gradient).cwiseAbs().maxCoeff(), 1e-12);
      s.insert(s.end(), gradient.begin(), gradient.end());
      s.insert(s.end(), factors.begin(), factors.begin() + 9);
      results[t] = s;
    }
    EXPECT_EQ(std::memcmp(results[0].data(), results[1].data(), results[0].size() * sizeof(double)), 0);
  }
}

TEST(SolverKernels, BlockUpdateEqualsThePlainProduct) {
  Random random(4);
  Matrix6d a, b, c;
  for (Matrix6d* m : {&a, &b, &c}) {
    for (int k = 0; k < 36; ++k) m->data()[k] = random.normal();
  }
  Matrix6d slow = c, fast = c;
  baseline_kernels().subtract_abt(slow.data(), a.data(), b.data());
  solver_kernels().subtract_abt(fast.data(), a.data(), b.data());
  EXPECT_LT((slow - (c - a * b.transpose())).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_EQ(slow, fast);
}

}  // namespace
}  // namespace dkb::solver
