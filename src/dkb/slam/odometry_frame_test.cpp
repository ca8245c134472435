// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/odometry_frame.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

Rigid3 pose(double x, double turn = 0) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY())), {x, 0.1, 0.2}};
}
double apart(const Rigid3& a, const Rigid3& b) {
  return (a.translation - b.translation).norm() + a.rotation.angularDistance(b.rotation);
}

TEST(OdometryFrame, IsTheWorldUntilSomethingJumps) {
  OdometryFrame odometry(pose(0.3));
  EXPECT_LT(apart(odometry.odom_from_cam(), pose(0.3)), 1e-12) << "the mount";
  odometry.update(pose(1, 0.2), false);
  EXPECT_LT(apart(odometry.world_from_odom(), Rigid3()), 1e-12);
  EXPECT_LT(apart(odometry.odom_from_cam(), pose(1, 0.2)), 1e-12);
}

TEST(OdometryFrame, AMapThatMovesTakesTheJump) {
  OdometryFrame odometry(Rigid3{});
  odometry.update(pose(1), false);
  const Rigid3 moved = pose(0.5, 0.1);
  odometry.move_world(moved);
  odometry.update(moved * pose(1.02), false);  // the camera went on by 2 cm
  EXPECT_LT(apart(odometry.odom_from_cam(), pose(1.02)), 1e-9);
  EXPECT_LT(apart(odometry.world_from_odom(), moved), 1e-9);
}

TEST(OdometryFrame, GoesOnFromWhereTheCameraWasLost) {
  OdometryFrame odometry(Rigid3{});
  odometry.update(pose(1), false);
  odometry.lost();
  odometry.update(pose(4, 1), false);
  EXPECT_LT(apart(odometry.odom_from_cam(), pose(1)), 1e-9);
  EXPECT_LT(apart(odometry.world_from_odom() * odometry.odom_from_cam(), pose(4, 1)), 1e-9);
  const Rigid3 step = pose(0.01, 0.02);
  odometry.update(pose(4, 1) * step, false);
  EXPECT_LT(apart(odometry.odom_from_cam(), pose(1) * step), 1e-9) << "and is smooth from then on";
}

TEST(OdometryFrame, APoseThatJumpsLeavesItWhereItIs) {
  OdometryFrame odometry(pose(0));
  odometry.update(pose(9), true);
  EXPECT_LT(apart(odometry.odom_from_cam(), pose(0)), 1e-9);
  EXPECT_LT(apart(odometry.world_from_odom() * odometry.odom_from_cam(), pose(9)), 1e-9);
}

}  // namespace
}  // namespace dkb
