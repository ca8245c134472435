// SPDX-License-Identifier: Apache-2.0
#include "motion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb_ros {
namespace {

Eigen::Quaterniond rotation_by(const Eigen::Vector3d& vector) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(vector.norm(), vector.normalized()));
}

// The camera on a robot: 0.2 m ahead of the base, 0.5 m up, looking ahead.
Rigid3 mount() {
  return {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.2, 0, 0.5}};
}

// base in odom of a robot that drives a circle: 0.5 m/s, 0.4 rad/s.
Rigid3 on_circle(double t) {
  const double v = 0.5, w = 0.4, r = v / w;
  return {rotation_by({0, 0, w * t}), {r * std::sin(w * t), r * (1 - std::cos(w * t)), 0}};
}

TEST(Twist, IsThatOfADriveAlongACircle) {
  const Rigid3 motion = on_circle(1).inverse() * on_circle(1.1);
  Vector6d expected;
  expected << 0.05, 0, 0, 0, 0, 0.04;
  EXPECT_LT((twist_of(motion) - expected).norm(), 1e-9);
  EXPECT_LT((twist_of(Rigid3(Eigen::Quaterniond::Identity(), {1, 2, 3})).head<3>() - Eigen::Vector3d(1, 2, 3)).norm(),
            1e-12);
}

TEST(Covariance, OfTheBaseIsThatOfPosesDrawnAroundTheCamera) {
  // Numerically: the base's pose for a small right perturbation of the camera's, in each of its six directions.
  const Rigid3 map_from_base = on_circle(2), map_from_cam = map_from_base * mount();
  Matrix6d j;
  for (int i = 0; i < 6; ++i) {
    Vector6d d = Vector6d::Zero();
    d(i) = 1e-6;
    const Rigid3 moved = map_from_cam * Rigid3(rotation_by(d.tail<3>()), d.head<3>()) * mount().inverse();
    const Eigen::AngleAxisd turn(moved.rotation * map_from_base.rotation.conjugate());  // about the fixed axes
    j.col(i) << (moved.translation - map_from_base.translation) / 1e-6, turn.angle() * turn.axis() / 1e-6;
  }
  Matrix6d in_camera = Matrix6d::Identity();
  in_camera.diagonal() << 1e-4, 2e-4, 3e-4, 1e-5, 2e-5, 3e-5;
  in_camera(0, 4) = in_camera(4, 0) = 1e-5;
  const Matrix6d ros = ros_covariance(in_camera, mount(), map_from_base.rotation);
  EXPECT_LT((ros - j * in_camera * j.transpose()).norm(), 1e-8);
  EXPECT_LT((camera_covariance(ros, mount(), map_from_base.rotation) - in_camera).norm(), 1e-12);
}

}  // namespace
}  // namespace dkb_ros
