// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>

namespace dkb {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

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

// Rigid motion between coordinate frames. `b_from_a` maps a point given in frame a to frame b:
//   point_in_b = b_from_a * point_in_a,   c_from_a = c_from_b * b_from_a.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();  // [m]

  Rigid3() = default;
  Rigid3(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : rotation(q), translation(t) {}

  Eigen::Matrix3d matrix3() const { return rotation.toRotationMatrix(); }
  Rigid3 inverse() const {
    const Eigen::Quaterniond q = rotation.conjugate();
    return {q, -(q * translation)};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }
  // The product is normalised, so that long chains stay rotations.
  Rigid3 operator*(const Rigid3& other) const {
    return {(rotation * other.rotation).normalized(), rotation * other.translation + translation};
  }
};

// Small motion from its tangent vector [translation m, rotation rad]; first-order coupling is left out, so that
// translation and rotation stay independent coordinates: T(d) = (exp(d_rot), d_trans).
inline Rigid3 rigid3_from_tangent(const Vector6d& d) {
  return {rotation_from_vector(d.tail<3>()), d.head<3>()};
}

// Camera centre in the world of a `cam_from_world`.
inline Eigen::Vector3d centre_in_world(const Rigid3& cam_from_world) {
  return -(cam_from_world.rotation.conjugate() * cam_from_world.translation);
}

}  // namespace dkb
