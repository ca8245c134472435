// SPDX-License-Identifier: Apache-2.0
#include "dkb/geometry/decompositions.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/SVD>

namespace dkb {

Vector6d solve_symmetric(const Matrix6d& m, const Vector6d& right) {
  return m.ldlt().solve(right);
}

Matrix6d inverse(const Matrix6d& m) {
  return m.inverse();
}

Matrix6d cholesky_root(const Matrix6d& m) {
  return m.llt().matrixL();
}

Spectrum<Vector6d, Matrix6d> spectrum(const Matrix6d& m) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(m);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Spectrum<Eigen::Vector3d, Eigen::Matrix3d> spectrum(const Eigen::Matrix3d& m) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(m);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to);
}

}  // namespace dkb
