// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/odometry_track.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>

#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

StampedPose pose(double time, double x, double turn = 0) {
  return {time, "", {Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitY())), {x, 0, 0}}};
}

TEST(OdometryTrack, MotionBetweenItsPosesIsInterpolated) {
  const OdometryTrack track({pose(1, 0), pose(1.1, 0.2), pose(1.2, 0.2, 0.1)}, 0.01);
  const auto prior = track.between(1.05, 1.1);
  ASSERT_TRUE(prior);
  EXPECT_NEAR(prior->previous_from_current.translation.x(), 0.1, 1e-12);
  EXPECT_FALSE(prior->rotation_only);
  const auto turn = track.between(1.1, 1.15);
  ASSERT_TRUE(turn);
  EXPECT_NEAR(turn->previous_from_current.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.05, 1e-9);
}

TEST(OdometryTrack, OutsideOfItAndInGapsItKnowsNothing) {
  const OdometryTrack track({pose(1, 0), pose(1.1, 0.1), pose(2, 0.2)}, 0.01);
  EXPECT_FALSE(track.between(0.9, 1.05));
  EXPECT_FALSE(track.between(1.05, 1.5)) << "0.9 s without a pose";
  EXPECT_FALSE(track.between(1.05, 2.1));
  EXPECT_TRUE(track.between(1, 2)) << "both are its own";
}

TEST(OdometryTrack, OverTenMetresTheDriftIsOneStandardDeviation) {
  const double drift = 0.02;
  Trajectory poses;
  for (int i = 0; i <= 1000; ++i) poses.push_back(pose(0.1 * i, 0.01 * i));
  const OdometryTrack track(std::move(poses), drift);
  MotionPrior whole = *track.between(0, 0.1);
  for (int i = 1; i < 1000; ++i) {
    const auto step = track.between(0.1 * i, 0.1 * (i + 1));
    ASSERT_TRUE(step);
    whole = joined(whole, *step);
  }
  EXPECT_NEAR(whole.previous_from_current.translation.x(), 10, 1e-6);
  EXPECT_NEAR(std::sqrt(whole.covariance(0, 0)), drift * 10, 0.02);
}

TEST(OdometryTrack, ATurnOnTheSpotIsAsUncertainAsItIsLarge) {
  const OdometryTrack track({pose(1, 0), pose(1.1, 0, 0.1), pose(1.2, 0.3, 0.1)}, 0.01);
  const Matrix6d turn = track.between(1, 1.1)->covariance, way = track.between(1.1, 1.2)->covariance;
  // (1 mrad)^2 + 0.01^2 * 10 * (0 m + 0.1 rad), and (0.3 m + 0 rad)
  EXPECT_NEAR(turn(3, 3), 1e-6 + 1e-4, 1e-9);
  EXPECT_NEAR(turn(0, 0), 1e-6, 1e-9);
  EXPECT_NEAR(way(3, 3), 1e-6 + 3e-4, 1e-9);
  EXPECT_NEAR(way(0, 0), 1e-6 + 3e-4, 1e-9);
}

TEST(OdometryTrack, WildPosesTellNothing) {
  const double far = 1e200;  // its square is infinite
  const OdometryTrack track({pose(1, 0), pose(1.1, far), pose(1.2, -far), pose(1.3, 0), pose(1.4, 2e6)}, 0.01);
  for (const double from : {1.0, 1.1, 1.2, 1.3}) EXPECT_FALSE(track.between(from, from + 0.1)) << from;
}

TEST(OdometryTrack, AFileSaysHowGoodItIs) {
  const auto folder = std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "odometry_track");
  std::filesystem::create_directories(folder);
  const auto good = folder / "good.txt", usual = folder / "usual.txt", bad = folder / "bad.txt";
  std::ofstream(good) << "# drift 0.05\n1 0 0 0 0 0 0 1\n1.1 1 0 0 0 0 0 1\n";
  std::ofstream(usual) << "1 0 0 0 0 0 0 1\n1.1 1 0 0 0 0 0 1\n";
  std::ofstream(bad) << "# drift much\n1 0 0 0 0 0 0 1\n";
  const auto sd = [](const OdometryTrack& track) { return std::sqrt(track.between(1, 1.1)->covariance(0, 0)); };
  EXPECT_NEAR(sd(read_odometry(good)) / sd(read_odometry(usual)), 5, 0.01);
  try {
    read_odometry(bad);
    FAIL() << "it was read";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("bad.txt:1: "), std::string::npos) << error.what();
  }
  for (const char* drift : {"1e160", "-0.05", "1.01"}) {
    std::ofstream(bad) << "# drift " << drift << "\n1 0 0 0 0 0 0 1\n1.1 1 0 0 0 0 0 1\n";
    EXPECT_EQ(test::input_error_of([&] { read_odometry(bad); }),
              bad.string() + ":1: drift " + drift +
                  " is out of range; it is the share of a way that its length is off by, 0 ... 1")
        << drift;
  }
  std::ofstream(bad) << "1 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n";
  EXPECT_THROW(read_odometry(bad), InputError) << "no motion in it";
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace dkb
