// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_smoothing.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

constexpr int kWidth = 80, kHeight = 60;

CameraModel camera() {
  CameraModel c;
  c.width = 320;
  c.height = 240;
  c.fx = c.fy = 262;
  c.cx = 159.5;
  c.cy = 119.5;
  return c;
}

// What arrives at each cell of a weight of 1 at (20, 30), on a surface of these depths.
Image<float> spread(const Image<float>& depth) {
  MotionSmoothing smoothing(camera(), {}, 4);
  smoothing.set_surface(depth);
  Image<float> weighted(kWidth, kHeight), weights(kWidth, kHeight);
  weighted(20, 30) = -1;
  weights(20, 30) = 1;
  smoothing.smooth(weighted, weights);
  for (size_t i = 0; i < weights.size(); ++i) EXPECT_FLOAT_EQ(weighted.data()[i], -weights.data()[i]);
  return weights;
}

TEST(MotionSmoothing, SpreadsOverASurfaceEvenlyAndLosesNothingButAtTheBorder) {
  const Image<float> weights = spread(Image<float>(kWidth, kHeight, 1.0f));
  EXPECT_GT(weights(20, 30), weights(25, 30));
  EXPECT_GT(weights(25, 30), weights(40, 30));
  EXPECT_GT(weights(40, 30), 0);
  EXPECT_NEAR(weights(14, 30), weights(26, 30), 0.2f * weights(26, 30));
}

TEST(MotionSmoothing, StopsAtDepthSteps) {
  Image<float> depth(kWidth, kHeight, 1.0f);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 30; x < kWidth; ++x) depth(x, y) = 1.1f;  // a step of 10 cm, where 3.5 cm bind
  const Image<float> weights = spread(depth);
  EXPECT_GT(weights(29, 30), 0);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 30; x < kWidth; ++x) ASSERT_EQ(weights(x, y), 0);
}

TEST(MotionSmoothing, IsDampedWhereABodyMeetsTheFloorButNotOnASlantedPlane) {
  // Inverse depth falls by 0.012 per cell and metre on a floor 1.3 m below the camera: it is a plane, slanted.
  Image<float> slanted(kWidth, kHeight), folded(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y)
    for (int x = 0; x < kWidth; ++x) {
      slanted(x, y) = 1.0f / (0.8f + 0.012f * static_cast<float>(y));
      folded(x, y) = y < 35 ? slanted(x, 35) : slanted(x, y);  // upright above row 35, where the floor begins
    }
  const float over_plane = spread(slanted)(20, 45), over_fold = spread(folded)(20, 45);
  EXPECT_GT(over_plane, 0);
  EXPECT_LT(over_fold, 0.3f * over_plane);
}

// With one sweep along rows and columns nothing would come round the corner: of somebody who fills the view, parts that
// hang together around a hole stayed apart, and he took the camera along.
TEST(MotionSmoothing, GoesRoundACorner) {
  Image<float> depth(kWidth, kHeight);
  for (int y = 25; y < 40; ++y)
    for (int x = 19; x < 22; ++x) depth(x, y) = 1;
  for (int y = 37; y < 40; ++y)
    for (int x = 19; x < 40; ++x) depth(x, y) = 1;
  const Image<float> weights = spread(depth);
  EXPECT_GT(weights(35, 38), 0);
  EXPECT_EQ(weights(35, 30), 0);
}

TEST(MotionSmoothing, MissingDepthIsNotEntered) {
  Image<float> near(kWidth, kHeight, 0.5f);
  for (int y = 25; y < 35; ++y)
    for (int x = 24; x < 34; ++x) near(x, y) = 0;
  const Image<float> weights = spread(near);
  EXPECT_EQ(weights(28, 30), 0);
  EXPECT_GT(weights(22, 30), 0);
}

}  // namespace
}  // namespace dkb
