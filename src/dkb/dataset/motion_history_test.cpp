// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dkb_slam/errors.h"
#include "dkb_slam/source.h"

namespace dkb::test {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Eigen::Quaterniond about_z(double angle) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()));
}

// A robot on a circle: 0.5 m/s and 0.4 rad/s about its z axis.
Rigid3 on_circle(double t) {
  const double angle = 0.4 * t, radius = 0.5 / 0.4;
  return {about_z(angle), {radius * std::sin(angle), radius * (1 - std::cos(angle)), 0}};
}

// The camera looks along the robot's x axis, 0.3 m in front of its middle.
const Rigid3 kBodyFromCam{Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {0.3, 0, 0.2}};

constexpr int64_t kFirst = 1'305'031'102'000'000'000;
int64_t ns(double t) {
  return kFirst + std::llround(t * 1e9);
}

OdometrySample odometry_at(double t) {
  OdometrySample sample;
  sample.stamp_ns = ns(t);
  sample.pose = on_circle(t);
  sample.twist << 0.5, 0, 0, 0, 0, 0.4;
  return sample;
}

GyroSample rates_at(double t) {
  return {ns(t), {0, 0, 0.4}};
}

// A sample every `step` [s], the one at `end` too.
template <class SampleAt>
MotionHistory history_of(const SampleAt& sample_at, double step, double end) {
  MotionHistory history;
  for (int i = 0; i * step <= end + 1e-9; ++i) EXPECT_TRUE(history.add(sample_at(i * step)));
  return history;
}

MotionHistory history_of(const OdometrySample& first, const OdometrySample& second) {
  MotionHistory history;
  EXPECT_TRUE(history.add(first) && history.add(second));
  return history;
}

void expect_near(const MotionPrior& prior, const Rigid3& truth, double tolerance) {
  EXPECT_LT((prior.previous_from_current.translation - truth.translation).norm(), tolerance);
  EXPECT_LT(prior.previous_from_current.rotation.angularDistance(truth.rotation), tolerance);
}

TEST(MotionHistory, OdometryGivesTheMotionBetweenItsSamples) {
  const MotionHistory history = history_of(odometry_at, 0.02, 1);
  const auto prior = history.between(ns(0.333), ns(0.366));
  ASSERT_TRUE(prior);
  EXPECT_FALSE(prior->rotation_only);
  expect_near(*prior, on_circle(0.333).inverse() * on_circle(0.366), 1e-4);
}

TEST(MotionHistory, OdometryIsCarriedOnByItsTwistForATenthOfASecond) {
  MotionHistory history = history_of(odometry_at, 0.02, 1);
  const auto prior = history.between(ns(0.98), ns(1.033));
  ASSERT_TRUE(prior);
  expect_near(*prior, on_circle(0.98).inverse() * on_circle(1.033), 1e-3);
  EXPECT_TRUE(history.between(ns(1.02), ns(1.1))) << "both lie beyond";
  EXPECT_FALSE(history.between(ns(0.98), ns(1.133)));
  EXPECT_FALSE(history.between(ns(-0.01), ns(0.033)));
  OdometrySample without = odometry_at(1.02);
  without.twist[1] = kNan, without.twist_variance.setConstant(0.01);
  EXPECT_TRUE(history.add(without)) << "its pose is one";
  EXPECT_FALSE(history.between(ns(1), ns(1.05)));
  const auto measured = history.between(ns(1), ns(1.02));
  ASSERT_TRUE(measured);
  EXPECT_EQ(measured->covariance, history_of(odometry_at(1), odometry_at(1.02)).between(ns(1), ns(1.02))->covariance)
      << "as without a twist's variance";
}

TEST(MotionHistory, OdometryWithoutVariancesIsOffByTheDrift) {
  const auto covariance = [](double drift) {
    MotionHistory history(drift);
    history.add(odometry_at(0)), history.add(odometry_at(0.1));
    return history.between(ns(0), ns(0.1))->covariance;
  };
  // 5 cm and 0.04 rad: (1 mm)^2 + 0.01^2 * 10 m * 0.05 m, and + 0.01^2 * 10 * (0.05 + 0.04).
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(covariance(0.01)(i, i), 1e-6 + 5e-5, 1e-7);
  for (int i = 3; i < 6; ++i) EXPECT_NEAR(covariance(0.01)(i, i), 1e-6 + 9e-5, 1e-7);
  // Another drift is that of the way alone.
  EXPECT_NEAR(covariance(0.1)(0, 0), 1e-6 + 5e-3, 1e-5);
  EXPECT_NEAR(covariance(0.1)(5, 5), 1e-6 + 5e-3 + 4e-5, 1e-5);
  for (const double drift : {-0.01, 1.01, kNan}) EXPECT_THROW(MotionHistory{drift}, InvalidOption) << drift;
}

TEST(MotionHistory, VariancesOfThePoseGoBeforeThoseOfTheTwist) {
  OdometrySample first = odometry_at(0), second = odometry_at(0.1);
  second.pose.rotation.setIdentity();
  second.twist_variance[0] = 4, second.twist_variance[5] = 9;  // x, about z
  const auto covariance = [&](double from, double to) {
    return history_of(first, second).between(ns(from), ns(to))->covariance;
  };
  EXPECT_NEAR(covariance(0, 0.1)(0, 0), 4 * 0.01 + 1e-6, 1e-9);
  EXPECT_NEAR(covariance(0, 0.1)(5, 5), 9 * 0.01 + 1e-6, 1e-9);
  first.pose_variance[0] = 0.5, second.pose_variance[0] = 0.7;
  EXPECT_NEAR(covariance(0, 0.1)(0, 0), 0.2 + 1e-6, 1e-9);
  EXPECT_NEAR(covariance(0.1, 0.2)(0, 0), 4 * 0.01 + 1e-6, 1e-9) << "carried on by the twist";
  second.pose_variance[0] = 1e9;
  EXPECT_EQ(covariance(0, 0.1)(0, 0), 1) << "as good as unknown";
}

TEST(MotionHistory, VariancesThatAreNoNumbersAreUnknown) {
  OdometrySample first = odometry_at(0), second = odometry_at(0.1);
  const MotionHistory plain = history_of(first, second);
  for (OdometrySample* s : {&first, &second})
    s->pose_variance.setConstant(kNan), s->twist_variance.setConstant(kInfinity);
  const MotionHistory history = history_of(first, second);
  for (const double to : {0.1, 0.15})
    EXPECT_EQ(history.between(ns(0), ns(to))->covariance, plain.between(ns(0), ns(to))->covariance) << to;
  const auto untold = [](double t) { return GyroSample{ns(t), {0, 0, 0.4}, Eigen::Vector3d::Constant(kNan)}; };
  EXPECT_EQ(history_of(untold, 0.005, 0.05).between(ns(0), ns(0.033))->covariance,
            history_of(rates_at, 0.005, 0.05).between(ns(0), ns(0.033))->covariance);
}

TEST(MotionHistory, GapsAndWhatLiesOutsideGiveNone) {
  MotionHistory history;
  for (const double t : {0.0, 0.1, 0.2, 1.0, 1.1}) history.add(odometry_at(t));
  EXPECT_TRUE(history.between(ns(0.05), ns(0.2)));
  EXPECT_TRUE(history.between(ns(0.2), ns(1.0))) << "both times were measured";
  EXPECT_FALSE(history.between(ns(0.2), ns(0.5)));
  EXPECT_FALSE(history.between(ns(-0.1), ns(0.1)));
  EXPECT_FALSE(history.between(ns(1.0), ns(1.21)));
  EXPECT_FALSE(history.between(ns(0.1), ns(0.1)));
  EXPECT_FALSE(history.between(ns(0.2), ns(0.1)));
  history.forget_before(ns(0.15));
  EXPECT_FALSE(history.between(ns(0.05), ns(0.2)));
  EXPECT_TRUE(history.between(ns(0.15), ns(0.2)));
  history.clear();
  EXPECT_FALSE(history.between(ns(0.15), ns(0.2)));
}

TEST(MotionHistory, ReachesUpToItsNewestSample) {
  MotionHistory history;
  EXPECT_FALSE(history.reaches(ns(0)));
  history.add(odometry_at(0.1));
  EXPECT_TRUE(history.reaches(ns(0.1)));
  EXPECT_FALSE(history.reaches(ns(0.15)));
}

TEST(MotionHistory, AGyroscopeGivesTheRotation) {
  MotionHistory history = history_of(rates_at, 0.005, 0.1);
  const auto prior = history.between(ns(0.003), ns(0.098));
  ASSERT_TRUE(prior);
  EXPECT_TRUE(prior->rotation_only);
  EXPECT_LT(prior->previous_from_current.rotation.angularDistance(about_z(0.4 * 0.095)), 1e-9);
  // 0.01 rad/s for 95 ms, and 1 mrad.
  EXPECT_NEAR(prior->covariance(3, 3), 1e-4 * 0.095 * 0.095 + 1e-6, 1e-12);
  EXPECT_TRUE(history.between(ns(0.003), ns(0.2))) << "the newest rate holds for a tenth of a second";
  EXPECT_FALSE(history.between(ns(0.003), ns(0.201)));
  GyroSample known = rates_at(0.105);
  known.rate_variance = {0.04, 0, 0};
  history.add(known);
  EXPECT_NEAR(history.between(ns(0.11), ns(0.16))->covariance(3, 3), 0.04 * 0.05 * 0.05 + 1e-6, 1e-9);
}

// From 0 to 1 rad/s in 0.1 s: after t seconds 5 t^2 rad.
TEST(MotionHistory, RatesChangeEvenlyFromSampleToSample) {
  MotionHistory history;
  history.add(GyroSample{ns(0)}), history.add(GyroSample{ns(0.1), {0, 0, 1}});
  const auto prior = history.between(ns(0.02), ns(0.06));
  ASSERT_TRUE(prior);
  EXPECT_LT(prior->previous_from_current.rotation.angularDistance(about_z(5 * (0.0036 - 0.0004))), 1e-9);
  history.add(GyroSample{ns(0.21)});
  EXPECT_FALSE(history.between(ns(0.08), ns(0.15))) << "samples 0.11 s apart";
}

TEST(MotionHistory, SamplesThatAreNoneAreLeftOut) {
  MotionHistory history;
  OdometrySample odometry = odometry_at(0);
  odometry.pose.translation.x() = kNan;
  EXPECT_FALSE(history.add(odometry));
  odometry = odometry_at(0);
  odometry.pose.rotation.coeffs() *= 1.1;
  EXPECT_FALSE(history.add(odometry));
  GyroSample rates = rates_at(0);
  rates.rate.x() = kInfinity;
  EXPECT_FALSE(history.add(rates));
  rates = rates_at(0);
  rates.rate_variance.x() = -1;  // no gyroscope
  EXPECT_FALSE(history.add(rates));
  EXPECT_FALSE(history.reaches(ns(0)));
  EXPECT_TRUE(history.add(odometry_at(0.02)));
  EXPECT_FALSE(history.add(odometry_at(0.02)));
  EXPECT_FALSE(history.add(rates_at(0.04))) << "of the other kind";
  EXPECT_FALSE(history.between(ns(0.02), ns(1.02)));
  history.clear();
  EXPECT_TRUE(history.add(rates_at(0.04)));
}

TEST(MotionHistory, HugeNumbersGiveNone) {
  MotionHistory odometry, rates;
  for (int i = 0; i < 4; ++i) {
    const double huge = i % 2 == 0 ? 1e308 : -1e308;
    OdometrySample sample = odometry_at(0.1 * i);
    sample.pose.translation.x() = huge, sample.twist.setConstant(huge);
    EXPECT_TRUE(odometry.add(sample));
    EXPECT_TRUE(rates.add(GyroSample{ns(0.05 * i), Eigen::Vector3d::Constant(huge)}));
  }
  EXPECT_FALSE(odometry.between(ns(0), ns(0.1)));
  EXPECT_FALSE(odometry.between(ns(0.05), ns(0.25)));
  EXPECT_FALSE(odometry.between(ns(0.3), ns(0.35)));
  EXPECT_FALSE(rates.between(ns(0), ns(0.12)));
  MotionHistory extreme;
  OdometrySample sample = odometry_at(0);
  sample.stamp_ns = std::numeric_limits<int64_t>::min();
  extreme.add(sample);
  EXPECT_FALSE(extreme.between(sample.stamp_ns, std::numeric_limits<int64_t>::max()));
}

TEST(MotionHistory, GoesOnAfterAStampThatWasFarAhead) {
  MotionHistory history;
  int refused = 0;
  for (int i = 0; i < 50; ++i) {
    refused += !history.add(odometry_at(0.02 * i));
    if (i != 20) continue;
    OdometrySample ahead = odometry_at(0.02 * i);
    ahead.stamp_ns += 3'600'000'000'000;
    EXPECT_TRUE(history.add(ahead));
  }
  EXPECT_EQ(refused, 9);
  EXPECT_TRUE(history.reaches(ns(0.9)));
  EXPECT_FALSE(history.reaches(ns(1000)));
  for (const double from : {0.2, 0.5, 0.8}) {  // before, around and after what was left out
    const auto prior = history.between(ns(from), ns(from + 0.1));
    ASSERT_TRUE(prior) << from;
    EXPECT_NEAR(prior->previous_from_current.translation.norm(), 0.05, 1e-3);
  }
}

TEST(MotionHistory, GoesOnAfterAClockThatWasSetBack) {
  MotionHistory history;
  EXPECT_TRUE(history.add(rates_at(3600)));
  for (int i = 0; i < 20; ++i) EXPECT_EQ(history.add(rates_at(0.005 * i)), i >= 9) << "the tenth is taken";
  EXPECT_TRUE(history.between(ns(0.05), ns(0.08)));
  MotionHistory long_before;
  for (int i = 0; i < 20; ++i) long_before.add(rates_at(100 + 0.01 * i));
  for (int i = 0; i < 50; ++i) long_before.add(rates_at(0.01 * i));
  EXPECT_TRUE(long_before.between(ns(0.2), ns(0.4)));
}

TEST(MotionHistory, HoldsTheNewestSamplesOnly) {
  MotionHistory history;
  for (int i = 0; i <= 20'000; ++i) history.add(rates_at(0.001 * i));
  EXPECT_FALSE(history.between(ns(0), ns(0.01)));
  EXPECT_TRUE(history.between(ns(0.001), ns(0.01)));
}

TEST(MovedToCamera, GivesTheMotionInTheCamerasAxes) {
  const auto of_body = history_of(odometry_at, 0.02, 0.8).between(ns(0.31), ns(0.343));
  ASSERT_TRUE(of_body);
  const MotionPrior prior = moved_to_camera(*of_body, kBodyFromCam.inverse());
  EXPECT_FALSE(prior.rotation_only);
  expect_near(prior, (on_circle(0.31) * kBodyFromCam).inverse() * (on_circle(0.343) * kBodyFromCam), 1e-5);
  // It goes forwards, that is along the camera's z, and turns about its y.
  EXPECT_NEAR(prior.previous_from_current.translation.z(), 0.5 * 0.033, 1e-3);
  EXPECT_NEAR(prior.previous_from_current.rotation.y(), -0.5 * 0.4 * 0.033, 1e-4);
}

// A turn of the robot moves a camera that stands in front of it: 0.3 m times the error of the turn, sideways.
TEST(MovedToCamera, CarriesTheCovariance) {
  OdometrySample first = odometry_at(0), second = odometry_at(0.1);
  second.twist_variance[5] = 1;
  const auto of_body = history_of(first, second).between(ns(0), ns(0.1));
  const Matrix6d covariance = moved_to_camera(*of_body, kBodyFromCam.inverse()).covariance;
  EXPECT_NEAR(covariance(4, 4), 0.01, 1e-4);         // about the camera's y
  EXPECT_NEAR(covariance(0, 0), 0.09 * 0.01, 1e-4);  // along its x
  EXPECT_LT(covariance(1, 1), 2e-4);
  EXPECT_GT(std::abs(covariance(0, 4)), 0.002);
}

TEST(MovedToCamera, ARotationAloneStaysOne) {
  const auto of_unit = history_of(rates_at, 0.005, 0.5).between(ns(0.1013), ns(0.1346));
  ASSERT_TRUE(of_unit);
  const MotionPrior prior = moved_to_camera(*of_unit, kBodyFromCam.inverse());
  EXPECT_TRUE(prior.rotation_only);
  EXPECT_EQ(prior.previous_from_current.translation.norm(), 0);
  EXPECT_NEAR(prior.previous_from_current.rotation.y(), -0.5 * 0.4 * 0.0333, 1e-6);
  // 0.01 rad/s for 33 ms, and 1 mrad.
  EXPECT_NEAR(prior.covariance(3, 3), 1e-4 * 0.0333 * 0.0333 + 1e-6, 1e-9);
}

}  // namespace
}  // namespace dkb::test
