// SPDX-License-Identifier: Apache-2.0
// Perspective-3-point by the distances of the three points, as the intersection of two conics through a degenerate
// member of their pencil (the approach of Persson and Nordberg, "Lambda Twist", ECCV 2018; derivation our own).
//
// With distances l = (l0, l1, l2) along the rays, each pair of points gives l^T M_ij l = |x_i - x_j|^2 = a_ij, where
// M_ij holds 1 on (i, i) and (j, j) and -cos(ray_i, ray_j) on (i, j). Eliminating the right-hand sides leaves two
// homogeneous conics D1, D2. Where det(D1 + g D2) = 0 the pencil's conic is a pair of lines; each meets D1 in two
// directions of l, and any a_ij gives the length.
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "dkb/geometry/decompositions.h"
#include "dkb/solver/absolute_pose.h"

namespace dkb {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Matrix3d adjugate(const Matrix3d& m) {
  Matrix3d a;
  a.row(0) = m.col(1).cross(m.col(2));
  a.row(1) = m.col(2).cross(m.col(0));
  a.row(2) = m.col(0).cross(m.col(1));
  return a;
}

// Real roots of c[3] x^3 + c[2] x^2 + c[1] x + c[0].
std::vector<double> real_cubic_roots(const double (&c)[4]) {
  const double b = c[2] / c[3], p = c[1] / c[3], q = c[0] / c[3];
  const double shift = b / 3, r = (2 * b * b * b - 9 * b * p + 27 * q) / 54, s = (b * b - 3 * p) / 9;
  std::vector<double> roots;
  if (r * r < s * s * s) {
    const double angle = std::acos(std::clamp(r / std::sqrt(s * s * s), -1.0, 1.0));
    for (int k = -1; k <= 1; ++k) {
      roots.push_back(-2 * std::sqrt(s) * std::cos((angle + 2 * M_PI * k) / 3) - shift);
    }
  } else {
    const double a = -std::copysign(std::cbrt(std::abs(r) + std::sqrt(r * r - s * s * s)), r);
    roots.push_back(a + (a != 0 ? s / a : 0) - shift);
  }
  for (double& x : roots) {
    for (int step = 0; step < 2; ++step) {
      const double slope = (3 * x + 2 * b) * x + p;
      if (slope != 0) x -= (((x + b) * x + p) * x + q) / slope;
    }
  }
  return roots;
}

// Directions on the plane through the origin with this normal where the form d vanishes.
std::vector<Vector3d> zeros_on_plane(const Matrix3d& d, const Vector3d& normal) {
  const Vector3d p = normal.unitOrthogonal(), q = normal.cross(p).normalized();
  const double a = p.dot(d * p), b = p.dot(d * q), c = q.dot(d * q);
  const double square = b * b - a * c;
  // A touching line may miss by rounding.
  const double scale = a * a + b * b + c * c;
  if (square < -1e-14 * scale || scale == 0) return {};
  const double root = std::sqrt(std::max(0.0, square)), t = -(b + std::copysign(root, b));
  // a x^2 + 2 b x y + c y^2 = 0: x : y is t : a and c : t.
  return {t * p + a * q, c * p + t * q};
}

struct Distances {
  Vector3d cosine;   // between rays 1 2, 0 2, 0 1
  Vector3d squared;  // between points 1 2, 0 2, 0 1

  // Newton steps on the three equations, which takes away what the elimination lost.
  void polish(Vector3d& l) const {
    for (int step = 0; step < 4; ++step) {
      Vector3d error;
      Matrix3d jacobian = Matrix3d::Zero();
      for (int k = 0; k < 3; ++k) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        error[k] = l[i] * l[i] + l[j] * l[j] - 2 * cosine[k] * l[i] * l[j] - squared[k];
        jacobian(k, i) = 2 * (l[i] - cosine[k] * l[j]);
        jacobian(k, j) = 2 * (l[j] - cosine[k] * l[i]);
      }
      const Vector3d next = l - Vector3d(jacobian.partialPivLu().solve(error));
      if (!next.allFinite()) return;
      l = next;
    }
  }
};

Matrix3d frame(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  Matrix3d f;
  f.col(0) = (b - a).normalized();
  f.col(2) = (b - a).cross(c - a).normalized();
  f.col(1) = f.col(2).cross(f.col(0));
  return f;
}

}  // namespace

std::vector<Rigid3> solve_p3p(const Vector3d (&points_in_world)[3], const Vector3d (&rays)[3]) {
  Distances known;
  Matrix3d forms[3];
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    known.cosine[k] = rays[i].dot(rays[j]);
    known.squared[k] = (points_in_world[i] - points_in_world[j]).squaredNorm();
    forms[k].setZero();
    forms[k](i, i) = forms[k](j, j) = 1;
    forms[k](i, j) = forms[k](j, i) = -known.cosine[k];
  }
  const Vector3d &x0 = points_in_world[0], &x1 = points_in_world[1], &x2 = points_in_world[2];
  const double longest = known.squared.maxCoeff();
  if (!(longest > 0) || (x1 - x0).cross(x2 - x0).norm() < 1e-6 * longest) return {};

  Matrix3d d1 = forms[2] * known.squared[0] - forms[0] * known.squared[2];
  Matrix3d d2 = forms[1] * known.squared[0] - forms[0] * known.squared[1];
  d1 /= d1.norm();
  d2 /= d2.norm();
  if (std::abs(d2.determinant()) < std::abs(d1.determinant())) std::swap(d1, d2);
  const double cubic[4] = {d1.determinant(), (adjugate(d1) * d2).trace(), (adjugate(d2) * d1).trace(),
                           d2.determinant()};
  if (std::abs(cubic[3]) < 1e-14) return {};

  // Of the degenerate conics the one that is most clearly a pair of real lines: eigenvalues of opposite signs.
  Vector3d lines[2];
  double clearest = 0;
  for (const double root : real_cubic_roots(cubic)) {
    Matrix3d conic = d1 + root * d2;
    const double norm = conic.norm();
    if (!(norm > 0) || !std::isfinite(norm)) continue;
    conic /= norm;
    const auto [s, axes] = spectrum(conic);
    if (!(-s[0] * s[2] > clearest)) continue;
    clearest = -s[0] * s[2];
    const Vector3d u = std::sqrt(s[2]) * axes.col(2), v = std::sqrt(-s[0]) * axes.col(0);
    lines[0] = u + v;
    lines[1] = u - v;
  }
  if (clearest == 0) return {};

  std::vector<Rigid3> poses;
  for (const Vector3d& line : lines) {
    for (Vector3d l : zeros_on_plane(d2, line)) {
      if (l.sum() < 0) l = -l;
      const double length = l.dot((forms[0] + forms[1] + forms[2]) * l);
      if (!(l.minCoeff() > 0) || !(length > 0)) continue;
      l *= std::sqrt(known.squared.sum() / length);
      known.polish(l);
      if (!(l.minCoeff() > 0)) continue;
      const Vector3d y0 = l[0] * rays[0], y1 = l[1] * rays[1], y2 = l[2] * rays[2];
      const Matrix3d rotation = frame(y0, y1, y2) * frame(x0, x1, x2).transpose();
      if (!rotation.allFinite()) continue;
      const Eigen::Quaterniond q = Eigen::Quaterniond(rotation).normalized();
      const Vector3d translation = (y0 + y1 + y2 - q * (x0 + x1 + x2)) / 3;
      poses.emplace_back(q, translation);
    }
  }
  return poses;
}

}  // namespace dkb
