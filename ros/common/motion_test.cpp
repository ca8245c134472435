// SPDX-License-Identifier: Apache-2.0
#include "motion.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb_ros {
namespace {

constexpr int64_t kMillisecond = 1'000'000;

// The camera on a robot: 0.2 m ahead of the base, 0.5 m up, looking ahead.
Rigid3 mount() {
  return {Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5), {0.2, 0, 0.5}};
}

// base in odom of a robot that drives a circle: 0.5 m/s, 0.4 rad/s.
Rigid3 on_circle(double t) {
  const double v = 0.5, w = 0.4, r = v / w;
  return {rotation_by({0, 0, w * t}), {r * std::sin(w * t), r * (1 - std::cos(w * t)), 0}};
}

OdometryMessage odometry_at(int64_t stamp_ns) {
  OdometryMessage m;
  m.stamp_ns = stamp_ns;
  m.child_frame_id = "base_link";
  m.pose = on_circle(1e-9 * static_cast<double>(stamp_ns));
  m.twist << 0.5, 0, 0, 0, 0, 0.4;
  return m;
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

TEST(OdometryHistory, GivesTheMotionBetweenItsMessages) {
  OdometryHistory history(0.02);
  for (int64_t t = 0; t <= 1000; t += 20) EXPECT_TRUE(history.add(odometry_at(t * kMillisecond)));
  const auto prior = history.between(333 * kMillisecond, 366 * kMillisecond);
  ASSERT_TRUE(prior);
  const Rigid3 truth = on_circle(0.333).inverse() * on_circle(0.366);
  EXPECT_LT((prior->previous_from_current.translation - truth.translation).norm(), 1e-4);
  EXPECT_LT(prior->previous_from_current.rotation.angularDistance(truth.rotation), 1e-4);
  // Beyond the newest message by its twist, but not far; and not before the first.
  EXPECT_TRUE(history.between(980 * kMillisecond, 1033 * kMillisecond));
  EXPECT_FALSE(history.between(980 * kMillisecond, 1133 * kMillisecond));
  EXPECT_FALSE(history.between(-10 * kMillisecond, 33 * kMillisecond));
}

TEST(OdometryHistory, IsAsSureAsARecordingsWithoutCovariances) {
  OdometryHistory history(0.01);
  history.add(odometry_at(0)), history.add(odometry_at(100 * kMillisecond));
  const Matrix6d covariance = history.between(0, 100 * kMillisecond)->covariance;
  // 5 cm and 0.04 rad: (1 mm)^2 + 0.01^2 * 10 m * 0.05 m, and + 0.01^2 * 10 * (0.05 + 0.04).
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(covariance(i, i), 1e-6 + 5e-5, 1e-7);
  for (int i = 3; i < 6; ++i) EXPECT_NEAR(covariance(i, i), 1e-6 + 9e-5, 1e-7);
}

TEST(OdometryHistory, CovariancesOfThePoseGoBeforeThoseOfTheTwist) {
  OdometryMessage first = odometry_at(0), second = odometry_at(100 * kMillisecond);
  second.pose.rotation.setIdentity();
  second.twist_covariance(0, 0) = 4, second.twist_covariance(5, 5) = 9;  // x, about z
  const auto covariance = [&](int64_t from_ns, int64_t to_ns) {
    OdometryHistory history(0.01);
    history.add(first), history.add(second);
    return history.between(from_ns, to_ns)->covariance;
  };
  EXPECT_NEAR(covariance(0, second.stamp_ns)(0, 0), 4 * 0.01 + 1e-6, 1e-9);
  EXPECT_NEAR(covariance(0, second.stamp_ns)(5, 5), 9 * 0.01 + 1e-6, 1e-9);
  first.pose_covariance(0, 0) = 0.5, second.pose_covariance(0, 0) = 0.7;
  EXPECT_NEAR(covariance(0, second.stamp_ns)(0, 0), 0.2 + 1e-6, 1e-9);
  EXPECT_NEAR(covariance(second.stamp_ns, second.stamp_ns + 100 * kMillisecond)(0, 0), 4 * 0.01 + 1e-6, 1e-9)
      << "carried on by the twist";
  second.pose_covariance(0, 0) = 1e9;
  EXPECT_EQ(covariance(0, second.stamp_ns)(0, 0), 1) << "as good as unknown";
}

TEST(OdometryHistory, LeavesOutWhatIsLateOrNoNumber) {
  OdometryHistory history(0.02);
  EXPECT_TRUE(history.add(odometry_at(20 * kMillisecond)));
  EXPECT_FALSE(history.add(odometry_at(20 * kMillisecond)));
  OdometryMessage broken = odometry_at(40 * kMillisecond);
  broken.pose.translation.x() = NAN;
  EXPECT_FALSE(history.add(broken));
  EXPECT_FALSE(history.between(20 * kMillisecond, 20 * kMillisecond + 1'000'000'000));
}

TEST(OdometryHistory, CovariancesThatAreNoNumbersAreUnknown) {
  OdometryMessage first = odometry_at(0), second = odometry_at(100 * kMillisecond);
  for (OdometryMessage* m : {&first, &second})
    m->pose_covariance.setConstant(NAN), m->twist_covariance.setConstant(INFINITY);
  OdometryHistory history(0.01), plain(0.01);
  ASSERT_TRUE(history.add(first) && history.add(second));
  plain.add(odometry_at(0)), plain.add(odometry_at(100 * kMillisecond));
  EXPECT_EQ(history.between(0, second.stamp_ns)->covariance, plain.between(0, second.stamp_ns)->covariance);
  const int64_t ahead_ns = second.stamp_ns + 50 * kMillisecond;
  EXPECT_EQ(history.between(0, ahead_ns)->covariance, plain.between(0, ahead_ns)->covariance);
}

TEST(GyroHistory, CovariancesThatAreNoNumbersAreUnknown) {
  GyroHistory history, plain;
  for (int64_t t = 0; t <= 50; t += 5) {
    ImuMessage m;
    m.stamp_ns = t * kMillisecond;
    plain.add(m);
    m.covariance.setConstant(NAN);
    EXPECT_TRUE(history.add(m));
  }
  EXPECT_EQ(history.between(0, 33 * kMillisecond)->covariance, plain.between(0, 33 * kMillisecond)->covariance);
  ImuMessage without;
  without.stamp_ns = 100 * kMillisecond;
  without.covariance(0, 0) = -1;
  EXPECT_FALSE(history.add(without));
}

TEST(OdometryHistory, GoesOnAfterAStampThatWasFarAhead) {
  OdometryHistory history(0.02);
  for (int64_t t = 0; t <= 100; t += 20) EXPECT_TRUE(history.add(odometry_at(t * kMillisecond)));
  OdometryMessage ahead = odometry_at(120 * kMillisecond);
  ahead.stamp_ns += 3'600'000'000'000;
  EXPECT_TRUE(history.add(ahead));
  for (int64_t t = 140; t <= 300; t += 20) EXPECT_FALSE(history.add(odometry_at(t * kMillisecond)));
  for (int64_t t = 320; t <= 420; t += 20) EXPECT_TRUE(history.add(odometry_at(t * kMillisecond)));
  EXPECT_TRUE(history.between(333 * kMillisecond, 366 * kMillisecond));
}

TEST(GyroHistory, GoesOnAfterAStampThatWasFarAhead) {
  GyroHistory history;
  ImuMessage m;
  m.stamp_ns = 3'600'000'000'000;
  EXPECT_TRUE(history.add(m));
  for (int64_t t = 0; t < 100; t += 5) {
    m.stamp_ns = t * kMillisecond;
    EXPECT_EQ(history.add(m), t >= 45) << "the tenth is taken";
  }
  EXPECT_TRUE(history.between(50 * kMillisecond, 80 * kMillisecond));
}

TEST(GyroHistory, AddsUpRotations) {
  GyroHistory history;
  ImuMessage m;
  m.angular_velocity = {0, 0, 0.4};
  for (int64_t t = 0; t <= 100; t += 5) {
    m.stamp_ns = t * kMillisecond;
    EXPECT_TRUE(history.add(m));
  }
  const auto prior = history.between(3 * kMillisecond, 98 * kMillisecond);
  ASSERT_TRUE(prior);
  EXPECT_TRUE(prior->rotation_only);
  EXPECT_LT(prior->previous_from_current.rotation.angularDistance(rotation_by({0, 0, 0.4 * 0.095})), 1e-9);
  // 0.01 rad/s for 95 ms, and 1 mrad.
  EXPECT_NEAR(prior->covariance(3, 3), 1e-4 * 0.095 * 0.095 + 1e-6, 1e-12);
  EXPECT_FALSE(history.between(3 * kMillisecond, 300 * kMillisecond));
  m.stamp_ns = 200 * kMillisecond;
  m.covariance(0, 0) = -1;  // an imu without a gyroscope
  EXPECT_FALSE(history.add(m));
}

// From 0 to 1 rad/s in 0.1 s: after t seconds 5 t^2 rad.
TEST(GyroHistory, RatesChangeEvenlyFromSampleToSample) {
  GyroHistory history;
  ImuMessage m;
  history.add(m);
  m.stamp_ns = 100 * kMillisecond, m.angular_velocity = {0, 0, 1};
  history.add(m);
  const auto prior = history.between(20 * kMillisecond, 60 * kMillisecond);
  ASSERT_TRUE(prior);
  EXPECT_LT(prior->previous_from_current.rotation.angularDistance(rotation_by({0, 0, 5 * (0.0036 - 0.0004)})), 1e-9);
}

TEST(MotionPrior, OfTheBaseIsTheCamerasAfterTheMount) {
  OdometryHistory history(0.02);
  for (int64_t t = 0; t <= 100; t += 20) history.add(odometry_at(t * kMillisecond));
  const auto prior = history.between(20 * kMillisecond, 80 * kMillisecond);
  ASSERT_TRUE(prior);
  const dkb::MotionPrior moved = moved_to_camera(*prior, mount().inverse());
  const Rigid3 truth = (on_circle(0.02) * mount()).inverse() * (on_circle(0.08) * mount());
  EXPECT_LT((moved.previous_from_current.translation - truth.translation).norm(), 1e-4);
  EXPECT_GT(moved.previous_from_current.translation.z(), 0.02);  // ahead is z
}

}  // namespace
}  // namespace dkb_ros
