// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb_slam/geometry.h"

namespace dkb {

// Eigen's decompositions are templates that take seconds to compile wherever one is used. Those of matrices that many
// rooms have are compiled once, here.

// x of m x = right for a symmetric m, by LDL^T.
Vector6d solve_symmetric(const Matrix6d& m, const Vector6d& right);

// By LU with pivots: not finite if m is singular.
Matrix6d inverse(const Matrix6d& m);

// The lower triangle L of m = L L^T for a positive definite m.
Matrix6d cholesky_root(const Matrix6d& m);

// Rising eigenvalues of a symmetric matrix and their unit vectors as columns.
template <class Vector, class Matrix>
struct Spectrum {
  Vector values;
  Matrix vectors;
};
Spectrum<Vector6d, Matrix6d> spectrum(const Matrix6d& m);
Spectrum<Eigen::Vector3d, Eigen::Matrix3d> spectrum(const Eigen::Matrix3d& m);

// The least rotation that turns the direction of `from` into that of `to`; about any axis if they are opposite.
Eigen::Quaterniond rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace dkb
