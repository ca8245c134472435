// SPDX-License-Identifier: Apache-2.0
#include "motion.h"

#include <cmath>

namespace dkb_ros {
namespace {

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

Matrix6d turned(const Eigen::Quaterniond& rotation) {
  Matrix6d m = Matrix6d::Zero();
  m.topLeftCorner<3, 3>() = m.bottomRightCorner<3, 3>() = rotation.toRotationMatrix();
  return m;
}

}  // namespace

Vector6d twist_of(const Rigid3& motion) {
  const Eigen::AngleAxisd turn(motion.rotation);
  double angle = turn.angle();
  if (angle > M_PI) angle -= 2 * M_PI;
  const Eigen::Vector3d w = angle * turn.axis();
  // The inverse of SO(3)'s left Jacobian.
  const double square = angle * angle;
  const double third = square < 1e-8 ? 1.0 / 12 : (1 - 0.5 * angle / std::tan(0.5 * angle)) / square;
  const Eigen::Matrix3d wx = skew(w);
  Vector6d twist;
  twist << motion.translation - 0.5 * wx * motion.translation + third * wx * wx * motion.translation, w;
  return twist;
}

Matrix6d adjoint(const Rigid3& a_from_b) {
  Matrix6d m = turned(a_from_b.rotation);
  m.topRightCorner<3, 3>() = skew(a_from_b.translation) * a_from_b.matrix3();
  return m;
}

Matrix6d ros_covariance(const Matrix6d& in_camera, const Rigid3& base_from_cam,
                        const Eigen::Quaterniond& parent_from_base) {
  const Matrix6d j = turned(parent_from_base) * adjoint(base_from_cam);
  return j * in_camera * j.transpose();
}

Matrix6d camera_covariance(const Matrix6d& ros, const Rigid3& base_from_cam,
                           const Eigen::Quaterniond& parent_from_base) {
  const Matrix6d j = adjoint(base_from_cam.inverse()) * turned(parent_from_base.conjugate());
  return j * ros * j.transpose();
}

}  // namespace dkb_ros
