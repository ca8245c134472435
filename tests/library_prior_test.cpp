// SPDX-License-Identifier: Apache-2.0
// Motion priors, and what they are for: stretches without vision, and places that somebody names.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "library_support.h"

namespace dkb::test {
namespace {

class LibraryPriors : public ::testing::Test {
 protected:
  // A frame with what wheels say that are off by `error` of the way, and know it.
  Frame driven(int index, const WallWorld::Look& look, int step = 1, double error = 0) const {
    Frame frame = world.frame(index, look);
    MotionPrior prior;
    prior.previous_from_current.translation.x() = (1 + error) * world.camera_x(step);
    prior.covariance = Matrix6d::Identity() * 1e-6;
    frame.set_prior(prior);
    return frame;
  }
  static double sd(const FrameResult& r) { return std::sqrt((*r.covariance)(0, 0)); }

  WallWorld world{320, 240};
};

TEST_F(LibraryPriors, APriorGuidesAJumpThatTheMotionModelMisses) {
  // The wall's picture repeats itself: a jump by one period looks like standing still.
  const int period = 48;
  const WallWorld repeating(320, 240, period);
  const double jump = repeating.camera_x(period);
  Options options;
  options.timing.estimate = false;  // a picture of the wall is made at once, and a jump is no motion while it is read
  for (const bool told : {false, true}) {
    Slam slam(repeating.camera(), options, Detectors::none());
    for (int i = 0; i < 6; ++i) ASSERT_TRUE(slam.process(repeating.frame(i, {})).tracked());
    Frame frame = repeating.frame(6, {.shift = period});
    MotionPrior prior;
    prior.previous_from_current.translation.x() = jump;
    if (told) frame.set_prior(prior);
    const FrameResult r = slam.process(frame);
    ASSERT_TRUE(r.tracked());
    EXPECT_NEAR(r.world_from_cam->translation.x(), told ? jump : 0, 0.005);
  }
}

TEST_F(LibraryPriors, AWrongPriorIsOverruledByTheImages) {
  Slam slam(world.camera(), Options(), Detectors::none());
  for (int i = 0; i < 10; ++i) {
    Frame frame = world.frame(i, {.shift = i});
    MotionPrior prior;
    prior.previous_from_current.translation = {0.4, -0.3, 0.2};
    frame.set_prior(prior);
    const FrameResult r = slam.process(frame);
    ASSERT_TRUE(r.tracked()) << i;
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), 3e-3);
  }
}

TEST_F(LibraryPriors, APriorThatIsNoNumberIsRefusedAndHarmsNothing) {
  Slam slam(world.camera(), Options(), Detectors::none()), undisturbed(world.camera(), Options(), Detectors::none());
  const auto frames = world.walk(0, 12);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i == 5) {
      MotionPrior prior;
      prior.previous_from_current.translation.z() = std::numeric_limits<double>::quiet_NaN();
      Frame bad = frames[i];
      EXPECT_NE(error_of([&] {
                  bad.set_prior(prior);
                  slam.process(bad);
                }).find("motion prior"),
                std::string::npos);
    }
    slam.process(frames[i]);
    undisturbed.process(frames[i]);
  }
  slam.finish();
  undisturbed.finish();
  EXPECT_EQ(bytes_of(slam), bytes_of(undisturbed));
}

TEST_F(LibraryPriors, ACovarianceThatIsNotSymmetricIsRefused) {
  Matrix6d half = Matrix6d::Identity();
  half(0, 4) = 0.5;  // as who fills in one triangle
  Frame frame = world.frame(0, {});
  EXPECT_NE(error_of([&] { frame.set_prior(MotionPrior{{}, false, half}); }).find("not symmetric"), std::string::npos);
  Slam slam(world.camera(), Options(), Detectors::none());
  EXPECT_NE(error_of([&] { slam.suggest_pose({}, half); }).find("not symmetric"), std::string::npos);
  half(4, 0) = 0.5 * (1 + 1e-9);  // as rounding leaves it
  EXPECT_EQ(error_of([&] { frame.set_prior(MotionPrior{{}, false, half}); }), "no error");
  EXPECT_EQ(error_of([&] { slam.suggest_pose({}, half); }), "no error");
}

TEST_F(LibraryPriors, InTheDarkThePoseGoesOnAndItsCovarianceGrows) {
  Slam slam(world.camera(), Options(), Detectors::none());
  double last_sd = 0;
  int keyframes = 0;
  for (int i = 0; i < 60; ++i) {
    const bool dark = i >= 20 && i < 35;
    const FrameResult r = slam.process(driven(i, {.shift = i, .dark = dark}, i > 0, 0.01));
    ASSERT_TRUE(r.tracked()) << i;
    ASSERT_TRUE(r.world_from_cam && r.odom_from_cam && r.covariance) << i;
    EXPECT_EQ(r.state == TrackingState::predicted, dark) << i << " " << name_of(r.state);
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), world.camera_x(1)) << i;
    if (dark) {
      EXPECT_GT(sd(r), last_sd) << i;
      EXPECT_FALSE(r.keyframe) << "nothing lasting is made of what nobody saw";
      EXPECT_EQ(r.inliers, 0);
    }
    if (i == 36) {
      EXPECT_LT(sd(r), last_sd);
    }
    last_sd = sd(r);
    keyframes += r.keyframe;
  }
  slam.finish();
  const Statistics s = slam.statistics();
  EXPECT_EQ(s.tracked, 60);
  EXPECT_EQ(s.predicted, 15);
  EXPECT_EQ(s.lost, 0);
  EXPECT_EQ(s.maps, 1);
  EXPECT_GT(keyframes, 0);
  EXPECT_EQ(slam.trajectory().size(), 60U);
  EXPECT_EQ(slam.online_trajectory().size(), 60U);
}

TEST_F(LibraryPriors, WhatAPriorWasOffByIsTheMapsBusinessAndNotOdometrys) {
  Slam slam(world.camera(), Options(), Detectors::none());
  double last_x = 0, last_map_x = 0, largest_step = 0, largest_map_step = 0;
  for (int i = 0; i < 60; ++i) {
    const bool dark = i >= 20 && i < 35;
    const FrameResult r = slam.process(driven(i, {.shift = i, .dark = dark}, i > 0, dark ? 0.5 : 0));
    ASSERT_TRUE(r.tracked()) << i;
    if (i > 0) {
      largest_step = std::max(largest_step, std::abs(r.odom_from_cam->translation.x() - last_x));
      largest_map_step = std::max(largest_map_step, std::abs(r.world_from_cam->translation.x() - last_map_x));
    }
    last_x = r.odom_from_cam->translation.x(), last_map_x = r.world_from_cam->translation.x();
  }
  EXPECT_NEAR(last_map_x, world.camera_x(59), world.camera_x(1));
  EXPECT_GT(largest_map_step, 5 * world.camera_x(1)) << "it was half of 15 steps off";
  EXPECT_LT(largest_step, 2 * world.camera_x(1));
}

// Many a driver leaves its covariance at zero.
TEST_F(LibraryPriors, ACovarianceOfZeroIsNoTrouble) {
  Slam slam(world.camera(), Options(), Detectors::none());
  for (int i = 0; i < 60; ++i) {
    Frame frame = world.frame(i, {.shift = i});
    if (i > 0) {
      MotionPrior prior;
      prior.previous_from_current.translation.x() = world.camera_x(1);
      prior.covariance.setZero();
      frame.set_prior(prior);
    }
    const FrameResult r = slam.process(frame);
    ASSERT_TRUE(r.tracked()) << i;
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), world.camera_x(1)) << i;
  }
  slam.finish();
  ASSERT_EQ(slam.trajectory().size(), 60U);
  EXPECT_NEAR(slam.trajectory().back().world_from_cam.translation.x(), world.camera_x(59), world.camera_x(1));
}

TEST_F(LibraryPriors, WhereTheMapWasLeftInTheDarkItGoesOnFromThere) {
  Slam slam(world.camera(), Options(), Detectors::none());
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(slam.process(driven(i, {.shift = i}, i > 0)).tracked());
  for (int i = 20; i < 40; ++i) slam.process(driven(i, {.dark = true}, 20));
  for (int i = 40; i < 90; ++i) {  // nothing here was ever seen
    const FrameResult r = slam.process(driven(i, {.shift = i + 380}, 1));
    ASSERT_TRUE(r.tracked()) << i;
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i + 380), 0.01) << i;
    if (i > 75) {
      EXPECT_EQ(r.state, TrackingState::tracking) << i;
    }
  }
  slam.finish();
  EXPECT_EQ(slam.statistics().maps, 1) << "the prior joins what lies before and after";
}

TEST_F(LibraryPriors, AWrongOneInTheDarkIsCorrectedByTheImages) {
  Slam slam(world.camera(), Options(), Detectors::none());
  for (int i = 0; i < 20; ++i) slam.process(driven(i, {.shift = i}, i > 0));
  for (int i = 20; i < 40; ++i) slam.process(driven(i, {.dark = true}, 4));  // the wheels slip: the camera stands still
  FrameResult r;
  for (int i = 40; i < 46; ++i) r = slam.process(driven(i, {.shift = 20}, 0));
  ASSERT_TRUE(r.tracked());
  EXPECT_NE(r.state, TrackingState::predicted);
  EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(20), 3e-3);
}

// Before a wall without a picture its depth tells the distance and two rotations; along the wall the velocity lasts.
TEST_F(LibraryPriors, BeforeABlankWallDepthCarriesThePose) {
  Slam slam(world.camera(), Options(), Detectors());
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(slam.process(world.frame(i, {.shift = i})).tracked());
  Vector6d before = Vector6d::Zero(), variance = Vector6d::Zero();
  for (int i = 20; i < 35; ++i) {
    const FrameResult r = slam.process(world.frame(i, {.shift = i, .blank = true}));
    ASSERT_EQ(r.state, TrackingState::predicted) << i;
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), 0.02) << i;
    EXPECT_NEAR(r.world_from_cam->translation.z(), 0, 0.01) << i;
    variance = r.covariance->diagonal();
    EXPECT_GT(variance[0], before[0]) << i;
    EXPECT_FALSE(r.keyframe);
    before = variance;
  }
  EXPECT_GT(variance[0], 4 * variance[2]) << "what the wall shows is known better";
  for (int i = 35; i < 45; ++i) {
    const FrameResult r = slam.process(world.frame(i, {.shift = i}));
    ASSERT_TRUE(r.tracked()) << i;
    if (i > 36) {
      EXPECT_NE(r.state, TrackingState::predicted) << i;
      EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), 5e-3) << i;
    }
  }
  slam.finish();
  EXPECT_EQ(slam.statistics().lost, 0);
  EXPECT_EQ(slam.statistics().maps, 1);
}

TEST_F(LibraryPriors, WithoutOneTheDarkIsALoss) {
  Slam slam(world.camera(), Options(), Detectors::none());
  for (int i = 0; i < 20; ++i) slam.process(driven(i, {.shift = i}, i > 0));
  EXPECT_EQ(slam.process(driven(20, {.dark = true})).state, TrackingState::predicted);
  EXPECT_EQ(slam.process(world.frame(21, {.dark = true})).state, TrackingState::lost);
  EXPECT_EQ(slam.process(driven(22, {.dark = true})).state, TrackingState::lost) << "where it begins is not known";
}

TEST_F(LibraryPriors, ARotationBridgesAsLongAsTheVelocityCanBeTakenToLast) {
  Options options;
  options.noise.pixel_sigma = 525 / world.camera().fx;  // this world moves by whole pixels: a pixel, whatever its angle
  Slam slam(world.camera(), options, Detectors::none());
  int predicted = 0, lost = 0;
  for (int i = 0; i < 80; ++i) {
    Frame frame = world.frame(i, {.shift = i, .dark = i >= 20});
    MotionPrior prior;
    prior.rotation_only = true;
    prior.covariance = Matrix6d::Identity() * 1e-6;
    frame.set_prior(prior);
    const FrameResult r = slam.process(frame);
    predicted += r.state == TrackingState::predicted;
    lost += r.state == TrackingState::lost;
    if (r.tracked()) {
      EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), 0.02) << i;
    }
  }
  // 2 m/s^2 until 0.14 s, by then 0.02 m, and 0.28 m/s from then on: 0.25 m after 0.95 s, 28 frames.
  EXPECT_NEAR(predicted, 28, 1);
  EXPECT_EQ(lost, 60 - predicted);
}

TEST_F(LibraryPriors, FramesThatWereNotLookedAtLeaveTheirMotionToTheNext) {
  Slam slam(world.camera(), Options(), Detectors::none());
  for (int i = 0; i < 20; ++i) slam.process(driven(i, {.shift = i}, i > 0));
  slam.pause(true);
  for (int i = 20; i < 30; ++i) slam.process(driven(i, {.shift = i}));
  slam.pause(false);
  const FrameResult r = slam.process(driven(30, {.dark = true}));
  ASSERT_EQ(r.state, TrackingState::predicted);
  EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(30), 3e-3);
}

TEST_F(LibraryPriors, ASuggestedPlaceTellsTwinsApart) {
  // The wall's picture repeats itself: many places explain the view.
  const int period = 144;
  const WallWorld twins(320, 240, period);
  double odom_step = 0;  // [m] largest, of a robot that steers by it
  const auto found_at = [&](std::optional<int> suggested) -> std::optional<double> {
    Slam slam(twins.camera(), Options(), Detectors::none());
    for (int i = 0; i < 220; ++i) slam.process(twins.frame(i, {.shift = 2 * i}));
    slam.localize_only(true);
    for (int i = 220; i < 225; ++i) slam.process(twins.frame(i, {.dark = true}));
    if (suggested) {
      Rigid3 pose;
      pose.translation.x() = twins.camera_x(*suggested) + 0.05;
      slam.suggest_pose(pose, Matrix6d::Identity() * 0.01);
    }
    FrameResult r;
    std::optional<double> odom_x;
    for (int i = 225; i < 235; ++i) {
      r = slam.process(twins.frame(i, {.shift = 40 + period}));
      if (!r.tracked()) continue;
      if (odom_x) odom_step = std::max(odom_step, std::abs(r.odom_from_cam->translation.x() - *odom_x));
      odom_x = r.odom_from_cam->translation.x();
    }
    if (!r.tracked()) return std::nullopt;
    return r.world_from_cam->translation.x();
  };
  for (const int place : {40, 40 + period, 40 + 2 * period}) {
    const auto x = found_at(place);
    ASSERT_TRUE(x) << place;
    EXPECT_NEAR(*x, twins.camera_x(place), 0.01) << place;
    EXPECT_LT(odom_step, 0.01) << place;
  }
}

TEST_F(LibraryPriors, ASuggestionMovesTheMapAndNotOdometry) {
  const int period = 144;
  const WallWorld twins(320, 240, period);
  Slam slam(twins.camera(), Options(), Detectors::none());
  FrameResult before;
  for (int i = 0; i < 220; ++i) before = slam.process(twins.frame(i, {.shift = 2 * i}));
  Rigid3 elsewhere = *before.world_from_cam;
  elsewhere.translation.x() -= twins.camera_x(period);
  slam.suggest_pose(elsewhere, Matrix6d::Identity() * 0.001);
  const FrameResult after = slam.process(twins.frame(220, {.shift = 438}));
  ASSERT_TRUE(after.tracked());
  EXPECT_NEAR(after.world_from_cam->translation.x(), twins.camera_x(438 - period), 0.02);
  EXPECT_NEAR(after.odom_from_cam->translation.x(), before.odom_from_cam->translation.x(), 0.02);
}

TEST_F(LibraryPriors, ASuggestionWaitsForTheMapThatIsBeingMade) {
  Options options;
  options.realtime = true;
  options.set("pipeline.mapper_latency", "0.02");  // what the first frames show is to be in the map by the third
  for (int run = 0; run < 5; ++run) {              // mapping may be quick by chance
    Slam slam(world.camera(), options, Detectors::none());
    for (int i = 0; i < 2; ++i) slam.process(world.frame(i, {.shift = i}));
    Rigid3 here;
    here.translation.x() = world.camera_x(1);
    slam.suggest_pose(here, Matrix6d::Identity() * 0.01);
    EXPECT_EQ(slam.process(world.frame(2, {.shift = 2})).state, TrackingState::relocalised);
  }
}

TEST_F(LibraryPriors, ASuggestionThatIsNoPoseIsRefused) {
  Slam slam(world.camera(), Options(), Detectors::none());
  Rigid3 nowhere;
  nowhere.translation.x() = std::nan("");
  EXPECT_NE(error_of([&] { slam.suggest_pose(nowhere, Matrix6d::Identity()); }).find("suggested pose: "),
            std::string::npos);
  EXPECT_NE(error_of([&] { slam.suggest_pose({}, Matrix6d::Zero()); }).find("positive definite"), std::string::npos);
}

}  // namespace
}  // namespace dkb::test
