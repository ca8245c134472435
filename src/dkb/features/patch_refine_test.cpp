// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/patch_refine.h"

#include <gtest/gtest.h>

#include "dkb/features/fast_corners.h"
#include "dkb/features/feature_test_util.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

using Motion = SquareWorld::Motion;

struct Outcome {
  size_t tried = 0, converged = 0;
  std::vector<double> errors;  // [px] of the converged ones
  double median() {
    std::sort(errors.begin(), errors.end());
    return errors[errors.size() / 2];
  }
};

// Patches at corners of the unmoved view, searched in the moved one from starts that are wrong by up to a pixel per
// axis.
Outcome align_all(const PatchRefiner& refiner, const Motion& motion, double noise, int brighter = 0,
                  const Eigen::Matrix2f& warp = Eigen::Matrix2f::Identity()) {
  const SquareWorld world(320, 240, 250, 8);
  const GreyImage first = world.render({}, noise, 1);
  GreyImage second = world.render(motion, noise, 2);
  for (size_t i = 0; i < second.size(); ++i)
    second.data()[i] = static_cast<uint8_t>(std::min(255, second.data()[i] + brighter));
  std::vector<PixelCorner> corners;
  FastCornerFinder().find(first, 30, 30, corners);
  Random random(4);
  Outcome outcome;
  for (const PixelCorner& corner : corners) {
    const Eigen::Vector2f point(static_cast<float>(corner.x) + 0.2F, static_cast<float>(corner.y) + 0.4F);
    ReferencePatch patch;
    if (!refiner.take(first, point, warp, patch)) continue;
    double x = 0, y = 0;
    world.move(motion, point.x(), point.y(), x, y);
    if (x < 20 || y < 20 || x > 299 || y > 219) continue;
    ++outcome.tried;
    const PatchAlignment found = refiner.refine(
        patch, second, {static_cast<float>(x + random.uniform(-1, 1)), static_cast<float>(y + random.uniform(-1, 1))});
    if (!found.converged) continue;
    ++outcome.converged;
    outcome.errors.push_back(std::hypot(found.position.x() - x, found.position.y() - y));
  }
  EXPECT_GT(outcome.tried, 100u);
  return outcome;
}

TEST(PatchRefine, FindsThePlaceToAFewHundredthsOfAPixel) {
  for (const int size : {6, 8, 10}) {
    Outcome outcome = align_all(PatchRefiner({.size = size}), {1, 0, 2.6, -1.3}, 0);
    EXPECT_GT(outcome.converged, 0.85 * static_cast<double>(outcome.tried));
    EXPECT_LT(outcome.median(), 0.05);
  }
}

TEST(PatchRefine, CameraNoiseCostsLessThanATenthOfAPixel) {
  Outcome outcome = align_all(PatchRefiner(), {1, 0, 2.6, -1.3}, 2.5);
  EXPECT_GT(outcome.converged, 0.85 * static_cast<double>(outcome.tried));
  EXPECT_LT(outcome.median(), 0.1);
}

TEST(PatchRefine, AChangeOfBrightnessDoesNotMatter) {
  Outcome outcome = align_all(PatchRefiner(), {1, 0, 2.6, -1.3}, 1.0, 15);
  EXPECT_GT(outcome.converged, 0.8 * static_cast<double>(outcome.tried));
  EXPECT_LT(outcome.median(), 0.1);
}

TEST(PatchRefine, TheWarpMakesUpForTurnAndScale) {
  const Motion motion = Motion::turned(0.5, 0.8, 1.0, 2.0);  // reference_from_current offsets are turned and scaled
  Eigen::Matrix2f warp;
  warp << static_cast<float>(motion.a), static_cast<float>(-motion.b), static_cast<float>(motion.b),
      static_cast<float>(motion.a);
  Outcome warped = align_all(PatchRefiner(), motion, 1.0, 0, warp);
  const Outcome plain = align_all(PatchRefiner(), motion, 1.0);
  EXPECT_GT(warped.converged, 0.85 * static_cast<double>(warped.tried));
  EXPECT_LT(warped.median(), 0.1);
  EXPECT_LT(plain.converged, warped.converged);
}

TEST(PatchRefine, VectorKernelsEqualScalarBitForBit) {
  const Outcome fast = align_all(PatchRefiner(), {1, 0, 2.6, -1.3}, 2.0);
  const Outcome scalar = align_all(PatchRefiner({}, Simd::scalar), {1, 0, 2.6, -1.3}, 2.0);
  EXPECT_EQ(fast.errors, scalar.errors);
}

TEST(PatchRefine, FlatForeignAndCutOffPatchesDoNotConverge) {
  const PatchRefiner refiner;
  const GreyImage flat(64, 64, 90), noise = noise_image(64, 64, 1), other = noise_image(64, 64, 2);
  ReferencePatch patch;
  ASSERT_TRUE(refiner.take(flat, {30, 30}, Eigen::Matrix2f::Identity(), patch));
  EXPECT_FALSE(refiner.refine(patch, flat, {30, 30}).converged);
  ASSERT_TRUE(refiner.take(noise, {30, 30}, Eigen::Matrix2f::Identity(), patch));
  EXPECT_FALSE(refiner.refine(patch, other, {30, 30}).converged);
  EXPECT_FALSE(refiner.refine(patch, noise, {2, 30}).converged);
  EXPECT_FALSE(refiner.refine(patch, noise, {NAN, 30}).converged);
  EXPECT_TRUE(refiner.refine(patch, noise, {30, 30}).converged);
  EXPECT_FALSE(refiner.take(noise, {3, 30}, Eigen::Matrix2f::Identity(), patch));
  EXPECT_FALSE(refiner.take(noise, {30, 61}, Eigen::Matrix2f::Identity(), patch));
  EXPECT_FALSE(refiner.take(noise, {30, 30}, 10 * Eigen::Matrix2f::Identity(), patch));
}

TEST(PatchRefine, RefusesBadOptions) {
  EXPECT_THROW(PatchRefiner({.size = 11}), InvalidOption);
  EXPECT_THROW(PatchRefiner({.epsilon = 0}), InvalidOption);
}

}  // namespace
}  // namespace dkb
