// SPDX-License-Identifier: Apache-2.0
#include "dkb/geometry/decompositions.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb {
namespace {

// Tridiagonal with 2 and -1: positive definite, with eigenvalues 2 - 2 cos(k pi / 7).
Matrix6d second_differences() {
  Matrix6d m = 2 * Matrix6d::Identity();
  for (int i = 0; i < 5; ++i) m(i, i + 1) = m(i + 1, i) = -1;
  return m;
}

TEST(Decompositions, SolvesAndInverts) {
  const Matrix6d m = second_differences();
  Vector6d x;
  x << 1, -2, 3, 0, 5, -6;
  EXPECT_LT((solve_symmetric(m, m * x) - x).norm(), 1e-13);
  // min(i, j) (7 - max(i, j)) / 7 for rows and columns from 1.
  for (int i = 1; i <= 6; ++i)
    for (int j = 1; j <= 6; ++j)
      EXPECT_NEAR(inverse(m)(i - 1, j - 1), std::min(i, j) * (7 - std::max(i, j)) / 7.0, 1e-13) << i << ", " << j;
  EXPECT_FALSE(inverse(Matrix6d::Zero()).allFinite());
}

TEST(Decompositions, TheCholeskyRootIsLowerAndSquaresToTheMatrix) {
  const Matrix6d root = cholesky_root(second_differences());
  EXPECT_NEAR(root(0, 0), std::sqrt(2.0), 1e-15);
  EXPECT_NEAR(root(1, 0), -1 / std::sqrt(2.0), 1e-15);
  EXPECT_EQ(root(0, 1), 0);
  EXPECT_LT((root * root.transpose() - second_differences()).norm(), 1e-14);
}

TEST(Decompositions, EigenvaluesRiseAndVectorsAreColumns) {
  const auto [values, vectors] = spectrum(second_differences());
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(values[k], 2 - 2 * std::cos((k + 1) * M_PI / 7), 1e-13) << k;
  EXPECT_LT((vectors * values.asDiagonal() * vectors.transpose() - second_differences()).norm(), 1e-13);

  Eigen::Matrix3d m;  // 1 and 3 in the plane of x and y, 5 along z
  m << 2, 1, 0, 1, 2, 0, 0, 0, 5;
  const auto three = spectrum(m);
  EXPECT_LT((three.values - Eigen::Vector3d(1, 3, 5)).norm(), 1e-14);
  EXPECT_NEAR(std::abs(three.vectors.col(0).dot(Eigen::Vector3d(1, -1, 0).normalized())), 1, 1e-14);
}

TEST(Decompositions, RotatesOneDirectionIntoAnother) {
  const Eigen::Vector3d from(0, 0, 2), to(3, 0, 0);
  const Eigen::Quaterniond quarter = rotation_between(from, to);
  EXPECT_LT((quarter * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_LT((quarter * Eigen::Vector3d::UnitY() - Eigen::Vector3d::UnitY()).norm(), 1e-15);
  EXPECT_LT((rotation_between(from, -from) * from + from).norm(), 1e-12);
}

}  // namespace
}  // namespace dkb
