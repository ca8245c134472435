// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_motion.h"

#include <gtest/gtest.h>

#include <limits>

#include "dkb/recordings/message_list_test_tools.h"
#include "dkb/recordings/recorded_source.h"
#include "dkb/util/stamps.h"

namespace dkb::test {
namespace {

// A robot on a circle: 0.5 m/s and 0.4 rad/s about its z axis.
Rigid3 on_the_circle(double t) {
  const double angle = 0.4 * t, radius = 0.5 / 0.4;
  return {Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ())),
          {radius * std::sin(angle), radius * (1 - std::cos(angle)), 0}};
}

// Looks along the robot's x axis, 0.3 m in front of its middle.
const Rigid3 kTurnedMount{Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {0.3, 0, 0.2}};

int64_t ns(double t) {
  return kFirst + static_cast<int64_t>(t * 1e9);
}

OdometryMessage odometry_at(double t) {
  OdometryMessage message;
  message.header = {ns(t), "odom", 0}, message.child_frame_id = "base";
  message.pose = {on_the_circle(t).translation, on_the_circle(t).rotation};
  return message;
}
ImuMessage imu_at(double t) {
  ImuMessage message;
  message.header = {ns(t), "imu", 0};
  message.angular_velocity = {0, 0, 0.4};
  return message;
}

void expect_motion(const MotionPrior& prior, double from, double to, double tolerance) {
  const Rigid3 truth = (on_the_circle(from) * kTurnedMount).inverse() * (on_the_circle(to) * kTurnedMount);
  EXPECT_LT((prior.previous_from_current.translation - truth.translation).norm(), tolerance);
  EXPECT_LT(prior.previous_from_current.rotation.angularDistance(truth.rotation), tolerance);
}

TEST(RecordedMotion, OdometryGivesTheMotionInTheCamerasAxes) {
  RecordedMotion motion(kTurnedMount);
  for (int i = 0; i < 40; ++i) motion.add(odometry_at(0.02 * i));
  const auto prior = motion.between(ns(0.31), ns(0.343));
  ASSERT_TRUE(prior);
  EXPECT_FALSE(prior->rotation_only);
  expect_motion(*prior, 0.31, 0.343, 1e-5);
  // It goes forwards, that is along the camera's z, and turns about its y.
  EXPECT_NEAR(prior->previous_from_current.translation.z(), 0.5 * 0.033, 1e-3);
  EXPECT_NEAR(prior->previous_from_current.rotation.y(), -0.5 * 0.4 * 0.033, 1e-4);
}

TEST(RecordedMotion, WithoutCovariancesADriftOfAHundredthIsAssumed) {
  RecordedMotion motion;
  motion.add(odometry_at(0)), motion.add(odometry_at(0.1));
  const Matrix6d covariance = motion.between(ns(0), ns(0.1))->covariance;
  // 5 cm and 0.04 rad: (1 mm)^2 + 0.01^2 * 10 m * 0.05 m, and + 0.01^2 * 10 * (0.05 + 0.04).
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(covariance(i, i), 1e-6 + 5e-5, 1e-7);
  for (int i = 3; i < 6; ++i) EXPECT_NEAR(covariance(i, i), 1e-6 + 9e-5, 1e-7);
}

TEST(RecordedMotion, CovariancesOfThePoseGoBeforeThoseOfTheTwist) {
  OdometryMessage first = odometry_at(0), second = odometry_at(0.1);
  second.pose.orientation.setIdentity();
  second.twist_covariance[0] = 4, second.twist_covariance[35] = 9;  // x, about z
  RecordedMotion by_twist;
  by_twist.add(first), by_twist.add(second);
  EXPECT_NEAR(by_twist.between(ns(0), ns(0.1))->covariance(0, 0), 4 * 0.01 + 1e-6, 1e-9);
  EXPECT_NEAR(by_twist.between(ns(0), ns(0.1))->covariance(5, 5), 9 * 0.01 + 1e-6, 1e-9);
  first.pose_covariance[0] = 0.5, second.pose_covariance[0] = 0.7;
  RecordedMotion by_pose;
  by_pose.add(first), by_pose.add(second);
  EXPECT_NEAR(by_pose.between(ns(0), ns(0.1))->covariance(0, 0), 0.2 + 1e-6, 1e-9);
  second.pose_covariance[0] = 1e9;
  RecordedMotion unknown;
  unknown.add(first), unknown.add(second);
  EXPECT_NEAR(unknown.between(ns(0), ns(0.1))->covariance(0, 0), 1, 1e-5);
}

// A turn of the robot moves a camera that stands in front of it: 0.3 m times the error of the turn, sideways.
TEST(RecordedMotion, CovariancesAreCarriedToTheCamera) {
  OdometryMessage first = odometry_at(0), second = odometry_at(0.1);
  second.twist_covariance[35] = 1;
  RecordedMotion motion(kTurnedMount);
  motion.add(first), motion.add(second);
  const Matrix6d covariance = motion.between(ns(0), ns(0.1))->covariance;
  EXPECT_NEAR(covariance(4, 4), 0.01, 1e-4);         // about the camera's y
  EXPECT_NEAR(covariance(0, 0), 0.09 * 0.01, 1e-4);  // along its x
  EXPECT_LT(covariance(1, 1), 2e-4);
  EXPECT_GT(std::abs(covariance(0, 4)), 0.002);
}

TEST(RecordedMotion, GapsAndWhatLiesOutsideGiveNone) {
  RecordedMotion motion;
  for (const double t : {0.0, 0.1, 0.2, 1.0, 1.1}) motion.add(odometry_at(t));
  EXPECT_TRUE(motion.between(ns(0.05), ns(0.2)));
  EXPECT_TRUE(motion.between(ns(0.2), ns(1.0))) << "both times were measured";
  EXPECT_FALSE(motion.between(ns(0.2), ns(0.5)));
  EXPECT_FALSE(motion.between(ns(-0.1), ns(0.1)));
  EXPECT_FALSE(motion.between(ns(1.0), ns(1.2)));
  EXPECT_FALSE(motion.between(ns(0.1), ns(0.1)));
  motion.forget_before(ns(0.15));
  EXPECT_FALSE(motion.between(ns(0.05), ns(0.2)));
  EXPECT_TRUE(motion.between(ns(0.15), ns(0.2)));
}

TEST(RecordedMotion, AnInertialUnitGivesTheRotation) {
  RecordedMotion motion(kTurnedMount);
  for (int i = 0; i < 100; ++i) motion.add(imu_at(0.005 * i));
  const auto prior = motion.between(ns(0.1013), ns(0.1346));
  ASSERT_TRUE(prior);
  EXPECT_TRUE(prior->rotation_only);
  EXPECT_NEAR(prior->previous_from_current.rotation.y(), -0.5 * 0.4 * 0.0333, 1e-6);
  // 0.01 rad/s for 33 ms, and 1 mrad.
  EXPECT_NEAR(prior->covariance(3, 3), 1e-4 * 0.0333 * 0.0333 + 1e-6, 1e-9);
  EXPECT_FALSE(motion.between(ns(0.4), ns(0.6)));
}

TEST(RecordedMotion, NumbersThatAreNoneAreLeftOut) {
  OdometryMessage odometry = odometry_at(0);
  odometry.pose.position.x() = std::numeric_limits<double>::quiet_NaN();
  ImuMessage imu = imu_at(0);
  imu.angular_velocity.x() = std::numeric_limits<double>::infinity();
  RecordedMotion motion;
  motion.add(odometry), motion.add(imu);
  imu = imu_at(0);
  imu.angular_velocity_covariance[0] = -1;  // no gyroscope
  EXPECT_FALSE(motion.add(imu));
  EXPECT_FALSE(motion.reaches(ns(0)));
}

TEST(RecordedMotion, HugeNumbersGiveNone) {
  RecordedMotion odometry, inertial;
  for (int i = 0; i < 4; ++i) {
    OdometryMessage message = odometry_at(0.1 * i);
    message.pose.position.x() = i % 2 == 0 ? 1e308 : -1e308;
    EXPECT_TRUE(odometry.add(message));
    ImuMessage rates = imu_at(0.05 * i);
    rates.angular_velocity = Eigen::Vector3d::Constant(i % 2 == 0 ? 1e308 : -1e308);
    EXPECT_TRUE(inertial.add(rates));
  }
  EXPECT_FALSE(odometry.between(ns(0), ns(0.1)));
  EXPECT_FALSE(odometry.between(ns(0.05), ns(0.25)));
  EXPECT_FALSE(inertial.between(ns(0), ns(0.12)));
}

TEST(RecordedMotion, OneStampFarAheadDoesNotEndIt) {
  RecordedMotion motion;
  int refused = 0;
  for (int i = 0; i < 50; ++i) {
    refused += !motion.add(odometry_at(0.02 * i));
    if (i == 20) refused += !motion.add(odometry_at(1000));
  }
  EXPECT_EQ(refused, 9);
  EXPECT_TRUE(motion.reaches(ns(0.9)));
  EXPECT_FALSE(motion.reaches(ns(1000)));
  for (const double from : {0.2, 0.5, 0.8}) {  // before, around and after what was left out
    const auto prior = motion.between(ns(from), ns(from + 0.1));
    ASSERT_TRUE(prior) << from;
    EXPECT_NEAR(prior->previous_from_current.translation.norm(), 0.05, 1e-3);
  }
}

TEST(RecordedMotion, AClockThatWasSetBackDoesNotEndIt) {
  RecordedMotion motion;
  for (int i = 0; i < 20; ++i) motion.add(imu_at(100 + 0.01 * i));
  for (int i = 0; i < 50; ++i) motion.add(imu_at(0.01 * i));
  EXPECT_TRUE(motion.between(ns(0.2), ns(0.4)));
}

// The odometry of each interval is recorded 50 ms after the images that end it.
TEST(RecordedMotion, ComesWithTheFramesOfARecording) {
  MessageList list;
  list.add("/tf_static", "tf2_msgs/TFMessage", 0, TransformsMessage{transform_message("base", "camera", kTurnedMount)});
  list.add("/rgb/camera_info", "sensor_msgs/CameraInfo", 0, info_message(small_camera(), "camera"));
  int odometry = 0;
  for (int n = 0; n < 20; ++n) {
    const double t = 1e-9 * static_cast<double>(n * kInterval);
    for (; 0.01 * odometry + 0.05 < t; ++odometry)
      list.add("/odom", "nav_msgs/Odometry", ns(t), odometry_at(0.01 * odometry));
    add_pairs(list, n, 1, "camera");
  }
  for (; odometry < 80; ++odometry) list.add("/odom", "nav_msgs/Odometry", ns(1), odometry_at(0.01 * odometry));
  size_t pictures = 0;
  for (MessageList::Message& m : list.messages())
    if (list.topics()[m.topic].name == "/rgb/image" && ++pictures == 8) m.bytes.resize(500);
  RecordedSource source(std::make_unique<MessageList>(list), "r.bag", {});
  double before = -1;
  int frames = 0;
  for (SourceFrame next = source.next(); next.state != SourceState::ended; next = source.next()) {
    if (next.state == SourceState::skipped) continue;
    const double now = 1e-9 * static_cast<double>(next.frame.stamp_ns() - kFirst);
    ASSERT_EQ(next.frame.prior().has_value(), before >= 0) << now;
    if (before >= 0) expect_motion(*next.frame.prior(), before, now, 1e-4);
    before = now;
    ++frames;
  }
  EXPECT_EQ(frames, 19) << "the motion through the one that is broken is part of the next one's";
}

}  // namespace
}  // namespace dkb::test
