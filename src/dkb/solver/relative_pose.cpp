// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/relative_pose.h"

namespace dkb::solver {
namespace {

// Derivative of log(exp(w) exp(x)) by x at 0: the inverse right Jacobian of SO(3),
// I + skew(w)/2 + (1/t^2 - (1 + cos t)/(2 t sin t)) skew(w)^2 with t = |w| (Forster et al., T-RO 2017, eq. 8).
Eigen::Matrix3d inverse_right_jacobian(const Eigen::Vector3d& w) {
  const double t = w.norm();
  const Eigen::Matrix3d k = skew(w);
  // (1 + cos t) / sin t = cot(t / 2), which stays finite at t = pi.
  const double factor = t < 1e-4 ? 1.0 / 12.0 : (1.0 - 0.5 * t / std::tan(0.5 * t)) / (t * t);
  return Eigen::Matrix3d::Identity() + 0.5 * k + factor * (k * k);
}

}  // namespace

Vector6d relative_pose_error(const Rigid3& cam_a_from_world, const Rigid3& cam_b_from_world,
                             const Rigid3& measured_b_from_a) {
  return tangent_from_rigid3(measured_b_from_a.inverse() * (cam_b_from_world * cam_a_from_world.inverse()));
}

RelativePoseResidual relative_pose_residual(const Rigid3& cam_a_from_world, const Rigid3& cam_b_from_world,
                                            const Rigid3& measured_b_from_a) {
  const Rigid3 predicted = cam_b_from_world * cam_a_from_world.inverse();
  const Rigid3 difference = measured_b_from_a.inverse() * predicted;
  RelativePoseResidual r;
  r.error = tangent_from_rigid3(difference);
  const Eigen::Matrix3d log_derivative = inverse_right_jacobian(r.error.tail<3>());
  // a: difference * T(d_a).
  r.jacobian_a.setZero();
  r.jacobian_a.topLeftCorner<3, 3>() = difference.matrix3();
  r.jacobian_a.bottomRightCorner<3, 3>() = log_derivative;
  // b: measured^-1 T(d_b)^-1 predicted.
  const Eigen::Matrix3d b_from_a = measured_b_from_a.matrix3();
  r.jacobian_b.setZero();
  r.jacobian_b.topLeftCorner<3, 3>() = -b_from_a.transpose();
  r.jacobian_b.topRightCorner<3, 3>() = b_from_a.transpose() * skew(predicted.translation);
  r.jacobian_b.bottomRightCorner<3, 3>() = -log_derivative * predicted.matrix3().transpose();
  return r;
}

Rigid3 perturbed(const Rigid3& cam_from_world, const Vector6d& d) {
  return rigid3_from_tangent(d).inverse() * cam_from_world;
}

}  // namespace dkb::solver
