// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/fast_corners.h"

#include <gtest/gtest.h>

#include "dkb/features/feature_test_util.h"

#ifdef DKB_TEST_OPENCV
#include <opencv2/features2d.hpp>
#endif

namespace dkb {
namespace {

std::vector<PixelCorner> find(const GreyImage& image, int threshold, int border, Simd simd = best_simd()) {
  std::vector<PixelCorner> corners;
  FastCornerFinder(simd).find(image, threshold, border, corners);
  return corners;
}

TEST(FastCorners, ScoreIsTheLargestThresholdThatStillFindsTheCorner) {
  // A single pixel 90 brighter than all around it: darker arcs of 9 exist up to a contrast below 90.
  GreyImage image(40, 20, 100);
  image(17, 9) = 190;
  EXPECT_EQ(find(image, 7, 3), (std::vector<PixelCorner>{{17, 9, 89}}));
  EXPECT_EQ(find(image, 89, 3).size(), 1u);
  EXPECT_TRUE(find(image, 90, 3).empty());
}

TEST(FastCorners, EqualNeighboursSuppressEachOther) {
  GreyImage image(40, 20, 100);
  image(17, 9) = image(18, 9) = 190;
  EXPECT_TRUE(find(image, 7, 3).empty());
}

TEST(FastCorners, VectorKernelEqualsScalar) {
  for (const int width : {64, 39, 38, 37, 100, 161})
    for (const int threshold : {1, 7, 20, 60}) {
      const GreyImage noise = noise_image(width, 40, static_cast<uint64_t>(width + threshold));
      const GreyImage scene = SquareWorld(width, 60, 30, 4).render({}, 3.0);
      for (const int border : {3, 5, 16}) {
        EXPECT_EQ(find(noise, threshold, border), find(noise, threshold, border, Simd::scalar));
        EXPECT_EQ(find(scene, threshold, border), find(scene, threshold, border, Simd::scalar));
      }
    }
}

TEST(FastCorners, ContrastWindowAgreesWithTheFinderAndBetweenKernels) {
  const GreyImage image = SquareWorld(120, 90, 40, 5).render({}, 2.0);
  const std::vector<PixelCorner> corners = find(image, 7, 5);
  ASSERT_GT(corners.size(), 20u);
  for (const PixelCorner& corner : corners) {
    uint8_t fast[25], scalar[25];
    fast_contrasts_5x5(image, corner.x, corner.y, fast);
    fast_contrasts_5x5(image, corner.x, corner.y, scalar, Simd::scalar);
    EXPECT_TRUE(std::equal(fast, fast + 25, scalar));
    EXPECT_EQ(fast[12], corner.score + 1);
  }
}

TEST(FastCorners, ImagesTooSmallForTheBorderHaveNone) {
  EXPECT_TRUE(find(noise_image(6, 6, 1), 7, 3).empty());
  EXPECT_TRUE(find(noise_image(38, 100, 1), 7, 19).empty());
}

#ifdef DKB_TEST_OPENCV
TEST(FastCorners, AreTheSameAsOpenCvsWithTheSameScores) {
  for (const uint64_t seed : {1, 2, 3}) {
    const GreyImage images[] = {noise_image(200, 150, seed), SquareWorld(320, 240, 200, seed).render({}, 2.0, seed)};
    for (const GreyImage& image : images)
      for (const int threshold : {7, 20, 40}) {
        const cv::Mat wrapped(image.height(), image.width(), CV_8U, const_cast<uint8_t*>(image.data()));
        std::vector<cv::KeyPoint> expected;
        cv::FAST(wrapped, expected, threshold, true, cv::FastFeatureDetector::TYPE_9_16);
        const std::vector<PixelCorner> corners = find(image, threshold, 3);
        ASSERT_EQ(corners.size(), expected.size());
        ASSERT_GT(corners.size(), 10u);
        for (size_t i = 0; i < corners.size(); ++i) {
          EXPECT_EQ(corners[i].x, expected[i].pt.x);
          EXPECT_EQ(corners[i].y, expected[i].pt.y);
          EXPECT_EQ(corners[i].score, expected[i].response);
        }
      }
  }
}
#endif

}  // namespace
}  // namespace dkb
