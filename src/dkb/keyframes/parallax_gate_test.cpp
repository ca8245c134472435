// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/parallax_gate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

Rigid3 camera_at(const Eigen::Vector3d& centre, double turn_deg) {
  return Rigid3(rotation_from_vector({0, turn_deg * M_PI / 180, 0}), centre).inverse();
}

TEST(ParallaxBetween, IsTheTurnInDegreesAndTheWayInTheUnit) {  // DKB eqs. 14-16
  const Rigid3 last = camera_at({1, 2, 3}, 10), now = camera_at({1.03, 2, 3.04}, 40);
  const Parallax centimetres = parallax_between(last, now, 100);
  EXPECT_NEAR(centimetres.rotation_deg, 30, 1e-9);
  EXPECT_NEAR(centimetres.translation, 5, 1e-9);  // sqrt(3^2 + 4^2)
  EXPECT_NEAR(parallax_between(last, now, 1).translation, 0.05, 1e-12);
  EXPECT_NEAR(centimetres.sum(), 35, 1e-9);
}

TEST(ParallaxBetween, StaysDefinedAtBothEndsOfTheArcCosine) {
  const Rigid3 at(rotation_from_vector({0.3, -0.2, 0.9}), {1, 2, 3});
  const Parallax none = parallax_between(at, at, 100);
  EXPECT_NEAR(none.rotation_deg, 0, 1e-5);
  EXPECT_EQ(none.translation, 0);
  EXPECT_NEAR(parallax_between(camera_at({0, 0, 0}, 0), camera_at({0, 0, 0}, 180), 1).rotation_deg, 180, 1e-5);
}

TEST(TranslationUnits, AreCentimetresOrPercentOfTheDepth) {
  EXPECT_EQ(units_per_metre(TranslationUnit::centimetre, 4), 100);
  EXPECT_EQ(units_per_metre(TranslationUnit::depth_percent, 4), 25);   // 1 m is 25% of 4 m
  EXPECT_EQ(units_per_metre(TranslationUnit::depth_percent, 0), 100);  // unknown
}

TEST(ParallaxFactor, IsTheLogarithmicShareOfTheLargestMotion) {  // DKB eqs. 19-24
  // Means 3 deg and 1 cm: w = 0.75 and 0.25, M = ln(1 + 2.25) + ln(1 + 0.25) = 1.178655 + 0.223144 = 1.401799,
  // the largest is ln(1 + 0.75 * 45) + ln(1 + 0.25 * 10) = 3.548180 + 1.252763 = 4.800943, F = 0.291984.
  EXPECT_NEAR(parallax_factor({3, 1}), 0.291984, 1e-5);
  // A turn alone: ln(1 + 9) / ln(1 + 45) = 2.302585 / 3.828641.
  EXPECT_NEAR(parallax_factor({9, 0}), 0.601411, 1e-5);
  EXPECT_NEAR(parallax_factor({45, 0}), 1, 1e-5);
}

TEST(ParallaxFactor, IsZeroAtRestAndAtMostOne) {
  EXPECT_EQ(parallax_factor({0, 0}), 0);  // eq. 24 is 0/0
  EXPECT_EQ(parallax_factor({90, 50}), 1);
}

TEST(ParallaxThreshold, FallsFromTheLargestToTheSmallest) {  // DKB eq. 25
  EXPECT_EQ(parallax_threshold(0), 30);
  EXPECT_EQ(parallax_threshold(0.25), 25);
  EXPECT_EQ(parallax_threshold(1), 10);
}

TEST(ParallaxGate, AveragesOverTheFramesThatAreThere) {  // DKB eqs. 17, 18
  ParallaxGate gate;
  EXPECT_EQ(gate.mean().sum(), 0);
  gate.passes({3, 6});
  EXPECT_EQ(gate.mean().rotation_deg, 3);  // one frame: the window is not yet full
  gate.passes({5, 0});
  EXPECT_EQ(gate.mean().rotation_deg, 4);
  EXPECT_EQ(gate.mean().translation, 3);
  for (int i = 0; i < 8; ++i) gate.passes({7, 0});
  gate.passes({9, 10});  // of eleven frames the first has left: 5 + 8 * 7 + 9 = 70
  EXPECT_EQ(gate.mean().rotation_deg, 7);
  EXPECT_EQ(gate.mean().translation, 1);
}

TEST(ParallaxGate, OpensAtTheThreshold) {
  // A turn alone: T = 30 - 20 ln(1 + 15) / ln(46) = 15.52, and 15.20 for 16 degrees.
  EXPECT_FALSE(ParallaxGate().passes({15, 0}));
  EXPECT_TRUE(ParallaxGate().passes({16, 0}));
}

TEST(ParallaxGate, IsWiderInFastMotion) {
  ParallaxGate slow, fast;
  for (int i = 0; i < 10; ++i) {
    slow.passes({0.1, 0.1});
    fast.passes({30, 30});
  }
  EXPECT_FALSE(slow.passes({9, 9}));
  EXPECT_TRUE(fast.passes({9, 9}));
  EXPECT_GT(slow.threshold(), fast.threshold());
}

TEST(ParallaxGate, AStillCameraKeepsItShut) {
  ParallaxGate gate;
  EXPECT_FALSE(gate.passes({0, 0}));
  EXPECT_EQ(gate.factor(), 0);
  EXPECT_EQ(gate.threshold(), 30);
}

}  // namespace
}  // namespace dkb
