// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/geometry/rigid3.h"

namespace dkb::solver {

// Residual d = [translation m, rotation rad] of predicted = measured * T(d), where predicted = cam_b_from_world *
// world_from_cam_a, and its derivatives by the right perturbations of world_from_cam_a and world_from_cam_b.
struct RelativePoseResidual {
  Vector6d error;
  Matrix6d jacobian_a, jacobian_b;
};
RelativePoseResidual relative_pose_residual(const Rigid3& cam_a_from_world, const Rigid3& cam_b_from_world,
                                            const Rigid3& measured_b_from_a);
// The error alone.
Vector6d relative_pose_error(const Rigid3& cam_a_from_world, const Rigid3& cam_b_from_world,
                             const Rigid3& measured_b_from_a);

// cam_from_world after the right perturbation world_from_cam * T(d).
Rigid3 perturbed(const Rigid3& cam_from_world, const Vector6d& d);

}  // namespace dkb::solver
