// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/image_pyramid.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dkb/features/feature_test_util.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

TEST(ImagePyramid, SizesFallByTheScaleAndAreRounded) {
  ImagePyramid pyramid({.levels = 8, .scale = 1.2});
  pyramid.build(GreyImage(640, 480));
  ASSERT_EQ(pyramid.levels(), 8);
  EXPECT_EQ(pyramid.level(1).width(), 533);   // 640 / 1.2 = 533.3
  EXPECT_EQ(pyramid.level(1).height(), 400);  // 480 / 1.2 = 400
  EXPECT_EQ(pyramid.level(7).width(), 179);   // 640 / 3.583 = 178.6
  EXPECT_EQ(pyramid.level(7).height(), 134);  // 480 / 3.583 = 133.96
}

TEST(ImagePyramid, ScaleTwoAveragesTwoByTwoPixels) {
  GreyImage image(8, 8);
  image(2, 4) = 10;
  image(3, 4) = 20;
  image(2, 5) = 30;
  image(3, 5) = 40;
  ImagePyramid pyramid({.levels = 2, .scale = 2.0, .min_size = 1});
  pyramid.build(image);
  EXPECT_EQ(pyramid.level(1)(1, 2), 25);
  EXPECT_EQ(pyramid.level(1)(0, 0), 0);
}

TEST(ImagePyramid, VectorKernelsEqualScalarBitForBit) {
  const int sizes[][2] = {{640, 480}, {641, 479}, {320, 200}, {97, 61}, {33, 40}, {17, 9}, {5, 3}};
  for (const auto& size : sizes)
    for (const double scale : {1.05, 1.2, 1.3, 1.5, 1.99, 2.0, 2.7}) {
      const GreyImage image = noise_image(size[0], size[1], 7);
      ImagePyramid scalar({.levels = 6, .scale = scale, .min_size = 1}, Simd::scalar);
      scalar.build(image);
      for (const Simd simd : {std::min(best_simd(), Simd::avx2), best_simd()}) {
        ImagePyramid fast({.levels = 6, .scale = scale, .min_size = 1}, simd);
        fast.build(image);
        ASSERT_EQ(fast.levels(), scalar.levels());
        for (int i = 0; i < fast.levels(); ++i) EXPECT_EQ(fast.level(i), scalar.level(i)) << size[0] << " " << scale;
      }
    }
}

TEST(ImagePyramid, KeepsALinearRampLinearInFullResolutionCoordinates) {
  // Bilinear interpolation reproduces a ramp exactly, so the value at a level's pixel is the ramp at its full position.
  GreyImage image(240, 60);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 240; ++x) image(x, y) = static_cast<uint8_t>(x);
  ImagePyramid pyramid({.levels = 6, .scale = 1.2});
  pyramid.build(image);
  for (int i = 0; i < pyramid.levels(); ++i)
    for (int x = 2; x < pyramid.level(i).width() - 2; ++x)
      EXPECT_NEAR(pyramid.level(i)(x, 5), pyramid.full_x(i, x), 0.51 * (i + 1));
}

TEST(ImagePyramid, PositionsMapToALevelAndBack) {
  ImagePyramid pyramid;
  pyramid.build(GreyImage(640, 480));
  EXPECT_DOUBLE_EQ(pyramid.full_x(0, 12.25), 12.25);
  EXPECT_NEAR(pyramid.full_x(3, -0.5), -0.5, 1e-12);  // outer edges coincide
  EXPECT_NEAR(pyramid.full_x(3, pyramid.level(3).width() - 0.5), 639.5, 1e-12);
  EXPECT_NEAR(pyramid.level_y(4, pyramid.full_y(4, 33.3)), 33.3, 1e-12);
}

TEST(ImagePyramid, RebuildingForAnotherImageOrSizeLeavesNothingBehind) {
  const GreyImage first = noise_image(320, 240, 1), second = noise_image(320, 240, 2), small = noise_image(60, 50, 3);
  ImagePyramid reused, fresh;
  reused.build(first);
  reused.build(second);
  fresh.build(second);
  for (int i = 0; i < fresh.levels(); ++i) EXPECT_EQ(reused.level(i), fresh.level(i));
  reused.build(small);
  ImagePyramid fresh_small;
  fresh_small.build(small);
  ASSERT_EQ(reused.levels(), fresh_small.levels());
  for (int i = 0; i < fresh_small.levels(); ++i) EXPECT_EQ(reused.level(i), fresh_small.level(i));
}

TEST(ImagePyramid, SmallImagesHaveFewerLevels) {
  ImagePyramid pyramid({.levels = 8, .scale = 2.0, .min_size = 8});
  pyramid.build(GreyImage(40, 20));
  EXPECT_EQ(pyramid.levels(), 2);  // 40x20, 20x10; 10x5 is too small
}

TEST(ImagePyramid, RefusesBadOptionsAndEmptyImages) {
  EXPECT_THROW(ImagePyramid({.levels = 0}), InvalidOption);
  EXPECT_THROW(ImagePyramid({.scale = 1.0}), InvalidOption);
  ImagePyramid pyramid;
  EXPECT_THROW(pyramid.build(GreyImage()), InputError);
}

}  // namespace
}  // namespace dkb
