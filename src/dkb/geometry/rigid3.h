// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "dkb_slam/geometry.h"

namespace dkb {

// Skew-symmetric matrix: skew(a) * b = a x b.
inline Eigen::Matrix3d skew(const Eigen::Vector3d& a) {
  Eigen::Matrix3d m;
  m << 0, -a.z(), a.y(), a.z(), 0, -a.x(), -a.y(), a.x(), 0;
  return m;
}

// Rotation by |w| radians about w (exponential map of SO(3)).
inline Eigen::Quaterniond rotation_from_vector(const Eigen::Vector3d& w) {
  const double angle = w.norm();
  if (angle < 1e-12) return Eigen::Quaterniond(1, 0.5 * w.x(), 0.5 * w.y(), 0.5 * w.z()).normalized();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle));
}

// Inverse of rotation_from_vector; the angle is in [0, pi].
inline Eigen::Vector3d vector_from_rotation(const Eigen::Quaterniond& q) {
  const double sign = q.w() < 0 ? -1.0 : 1.0;
  const Eigen::Vector3d v = sign * q.vec();
  const double n = v.norm();
  if (n < 1e-12) return 2.0 * v;
  return (2.0 * std::atan2(n, sign * q.w()) / n) * v;
}

// Small motion from its tangent vector [translation m, rotation rad]; first-order coupling is left out, so that
// translation and rotation stay independent coordinates: T(d) = (exp(d_rot), d_trans).
inline Rigid3 rigid3_from_tangent(const Vector6d& d) {
  return {rotation_from_vector(d.tail<3>()), d.head<3>()};
}

// Inverse of rigid3_from_tangent.
inline Vector6d tangent_from_rigid3(const Rigid3& motion) {
  Vector6d d;
  d << motion.translation, vector_from_rotation(motion.rotation);
  return d;
}

// Right perturbations [translation, rotation] in frame b as such in frame a: the adjoint of a_from_b.
inline Matrix6d adjoint(const Rigid3& a_from_b) {
  const Eigen::Matrix3d r = a_from_b.matrix3();
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = m.bottomRightCorner<3, 3>() = r;
  m.topRightCorner<3, 3>() = skew(a_from_b.translation) * r;
  return m;
}

// The covariance of a right perturbation in frame b as that of one in frame a.
inline Matrix6d carried(const Rigid3& a_from_b, const Matrix6d& covariance) {
  const Matrix6d carry = adjoint(a_from_b);
  return carry * covariance * carry.transpose();
}

// Camera centre in the world of a `cam_from_world`.
inline Eigen::Vector3d centre_in_world(const Rigid3& cam_from_world) {
  return -(cam_from_world.rotation.conjugate() * cam_from_world.translation);
}

}  // namespace dkb
