// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/subpixel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "dkb/features/fast_corners.h"
#include "dkb/features/feature_test_util.h"

namespace dkb {
namespace {

constexpr double kNoise = 2.4;  // [grey levels] as refine_corner() takes it

// Dark left of x = 50 and above y = 40 (or everywhere to the left), light elsewhere, with a soft edge of two pixels.
GreyImage step(double contrast, bool is_corner, uint64_t seed) {
  Random random(seed);
  GreyImage image(100, 80);
  for (int y = 0; y < 80; ++y)
    for (int x = 0; x < 100; ++x) {
      const double right = std::clamp((x - 49.0) / 2, 0.0, 1.0), below = std::clamp((y - 39.0) / 2, 0.0, 1.0);
      image(x, y) = static_cast<uint8_t>(
          std::clamp(100 + contrast * (is_corner ? right * below : right) + kNoise * random.normal(), 0.0, 255.0));
    }
  return image;
}

// Standard deviation [px] of where a corner is found, in the direction in which it varies most, and what is said of it.
struct Scatter {
  double found = 0, said = 0;
};
Scatter scatter(double contrast) {
  Eigen::Matrix2d squares = Eigen::Matrix2d::Zero();
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  std::vector<float> said;
  constexpr int kDraws = 400;
  for (int i = 0; i < kDraws; ++i) {
    const SubpixelOffset at = refine_corner(step(contrast, true, static_cast<uint64_t>(i) + 1), 51, 41);
    const Eigen::Vector2d p(at.x, at.y);
    sum += p;
    squares += p * p.transpose();
    said.push_back(at.sigma);
  }
  const Eigen::Matrix2d covariance = squares / kDraws - sum * sum.transpose() / (kDraws * kDraws);
  std::nth_element(said.begin(), said.begin() + kDraws / 2, said.end());
  const double half = covariance.trace() / 2, largest = half + std::sqrt(half * half - covariance.determinant());
  return {std::sqrt(largest), said[kDraws / 2]};
}

TEST(RefineCorner, SaysHowFarNoiseMovesACorner) {
  for (const double contrast : {100.0, 50.0, 25.0}) {
    const Scatter s = scatter(contrast);
    EXPECT_LT(s.found, 1.5 * s.said) << contrast;
    EXPECT_GT(s.found, 0.3 * s.said) << contrast;  // contrasts beside each other share their noise
  }
}

TEST(RefineCorner, AWeakCornerIsLessSureInProportion) {
  EXPECT_NEAR(scatter(25).said / scatter(100).said, 4, 1);
}

// What FAST finds on an edge is anywhere along it.
TEST(RefineCorner, OnAnEdgeItsPlaceIsNotKnown) {
  std::vector<float> said;
  FastCornerFinder finder;
  std::vector<PixelCorner> corners;
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    const GreyImage image = step(60, false, seed);
    finder.find(image, 7, 5, corners);
    for (const PixelCorner& c : corners) said.push_back(refine_corner(image, c.x, c.y).sigma);
  }
  ASSERT_GT(said.size(), 20U);
  const auto middle = said.begin() + static_cast<long>(said.size() / 2);
  std::nth_element(said.begin(), middle, said.end());
  EXPECT_GT(*middle, 4 * scatter(60).said);
}

}  // namespace
}  // namespace dkb
