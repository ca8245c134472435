// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/keyframe_motion.h"

#include <algorithm>

#include "dkb/geometry/rigid3.h"

namespace dkb {
namespace {

// Standard deviations.
constexpr double kPositionSd = 0.005;      // [m]
constexpr double kPositionShare = 0.01;    // of the edge's length
constexpr double kRotationSd = 0.002;      // [rad]
constexpr double kRotationGrowth = 0.004;  // [rad/m]
constexpr double kRotationShare = 0.02;    // of the edge's rotation

}  // namespace

Matrix6d edge_covariance(const Rigid3& b_from_a, int shared_points) {
  const double length = b_from_a.translation.norm();
  const double position = kPositionSd + kPositionShare * length;
  const double rotation =
      kRotationSd + kRotationGrowth * length + kRotationShare * vector_from_rotation(b_from_a.rotation).norm();
  const double share = std::clamp(shared_points / static_cast<double>(kEssentialSharedPoints), 0.1, 4.0);
  Matrix6d covariance = Matrix6d::Zero();
  covariance.diagonal().head<3>().setConstant(position * position / share);
  covariance.diagonal().tail<3>().setConstant(rotation * rotation / share);
  return covariance;
}

MotionPrior ride_on(const Rigid3& cam_from_parent, int shared_points) {
  return {cam_from_parent.inverse(), false, edge_covariance(cam_from_parent, shared_points)};
}

}  // namespace dkb
