// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/relative_pose.h"

#include <gtest/gtest.h>

#include "dkb/util/random.h"

namespace dkb::solver {
namespace {

Rigid3 random_pose(Random& random, double angle) {
  Vector6d d;
  for (double& value : d) value = random.normal();
  d.tail<3>() *= angle / d.tail<3>().norm();
  return rigid3_from_tangent(d);
}

TEST(RelativePoseResidual, AnalyticJacobianEqualsNumeric) {
  Random random(2);
  for (const double angle : {0.0, 1e-6, 1e-3, 0.5, 2.0, 3.0}) {
    const Rigid3 a = random_pose(random, 1), b = random_pose(random, 2);
    const Rigid3 measured = b * a.inverse() * random_pose(random, angle);
    const RelativePoseResidual r = relative_pose_residual(a, b, measured);
    EXPECT_NEAR(r.error.tail<3>().norm(), angle, 1e-9);
    EXPECT_EQ(r.error, relative_pose_error(a, b, measured));
    const double h = 1e-6;
    for (int k = 0; k < 6; ++k) {
      const Vector6d step = h * Vector6d::Unit(k);
      const Vector6d by_a = (relative_pose_error(perturbed(a, step), b, measured) -
                             relative_pose_error(perturbed(a, -step), b, measured)) /
                            (2 * h);
      const Vector6d by_b = (relative_pose_error(a, perturbed(b, step), measured) -
                             relative_pose_error(a, perturbed(b, -step), measured)) /
                            (2 * h);
      EXPECT_LT((by_a - r.jacobian_a.col(k)).norm(), 1e-7) << angle << " " << k;
      EXPECT_LT((by_b - r.jacobian_b.col(k)).norm(), 1e-7) << angle << " " << k;
    }
  }
}

TEST(RelativePoseResidual, IsTheTangentOfWhatFollowsTheMeasurement) {
  const Rigid3 measured(rotation_from_vector({0.1, 0.2, 0.3}), {1, 2, 3});
  Vector6d d;
  d << 0.01, -0.02, 0.03, 0.2, 0.1, -0.3;
  EXPECT_LT((relative_pose_error(Rigid3(), measured * rigid3_from_tangent(d), measured) - d).norm(), 1e-12);
}

TEST(Perturbed, MovesTheCameraInItsOwnAxes) {
  // A camera that looks along the world's x; a step of 1 m ahead (its z) leads along x.
  const Rigid3 cam_from_world = Rigid3(rotation_from_vector({0, M_PI / 2, 0}), {0, 0, 0}).inverse();
  Vector6d ahead = Vector6d::Zero();
  ahead[2] = 1;
  EXPECT_LT((centre_in_world(perturbed(cam_from_world, ahead)) - Eigen::Vector3d(1, 0, 0)).norm(), 1e-12);
}

}  // namespace
}  // namespace dkb::solver
