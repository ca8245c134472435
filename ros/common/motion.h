// SPDX-License-Identifier: Apache-2.0
// Motions and their covariances in ROS' terms.
#pragma once

#include "types.h"

namespace dkb_ros {

// The twist [v, w] that is this motion after one second, in the axes of the moving frame.
Vector6d twist_of(const Rigid3& motion);
// Maps right perturbations [translation, rotation] in frame b to the same in frame a.
Matrix6d adjoint(const Rigid3& a_from_b);
// The library's covariance, a right perturbation in camera axes, as that of the base's pose in ROS' order: position and
// rotation about the fixed axes of the parent frame.
Matrix6d ros_covariance(const Matrix6d& in_camera, const Rigid3& base_from_cam,
                        const Eigen::Quaterniond& parent_from_base);
// The reverse, for /initialpose.
Matrix6d camera_covariance(const Matrix6d& ros, const Rigid3& base_from_cam,
                           const Eigen::Quaterniond& parent_from_base);

}  // namespace dkb_ros
