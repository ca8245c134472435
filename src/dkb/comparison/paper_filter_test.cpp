// SPDX-License-Identifier: Apache-2.0
#include "dkb/comparison/paper_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace dkb {
namespace {

// `near` times 2 m and `far` times 4 m: the far ones are (near / far)^0.5 sigma from the mean, and s = near / far.
std::vector<double> two_depths(size_t near, size_t far) {
  std::vector<double> depths(near, 2.0);
  depths.insert(depths.end(), far, 4.0);
  return depths;
}

int dynamic_count(const std::vector<double>& depths) {
  const auto verdict = depth_test(depths);
  return std::accumulate(verdict.begin(), verdict.end(), 0);
}

TEST(PaperFilter, MeanAndSigmaAreThoseOfEquations10And11) {
  const DepthSpread s = depth_spread(std::vector<double>{1, 2, 3, 4, 6});
  ASSERT_TRUE(s.usable);
  EXPECT_NEAR(s.mean, 3.2, 1e-12);               // 16 / 5
  EXPECT_NEAR(s.sigma, std::sqrt(2.96), 1e-12);  // (4.84 + 1.44 + 0.04 + 0.64 + 7.84) / 5
}

TEST(PaperFilter, TheSpreadRatioIsTakenAboutTheMean) {
  const DepthSpread s = depth_spread(std::vector<double>{1, 2, 3, 4, 6});
  // Above 3.2: 0.8, 2.8: (0.64 + 7.84) / 2 = 4.24; below: 2.2, 1.2, 0.2: (4.84 + 1.44 + 0.04) / 3 = 6.32 / 3.
  EXPECT_NEAR(s.ratio, std::sqrt(4.24 / (6.32 / 3)), 1e-12);
  EXPECT_EQ(s.delta, 2.8);
}

TEST(PaperFilter, ASkewedBoxGetsTheWideThreshold) {
  const DepthSpread s = depth_spread(two_depths(10, 1));
  EXPECT_NEAR(s.ratio, 10, 1e-9);
  EXPECT_EQ(s.delta, 9.0);
  EXPECT_NEAR(depth_spread(two_depths(7, 1)).ratio, 7, 1e-9);
  EXPECT_EQ(depth_spread(two_depths(7, 1)).delta, 2.8);
}

TEST(PaperFilter, DepthsBeyondDeltaAreDynamic) {
  EXPECT_EQ(dynamic_count(two_depths(5, 1)), 1);   // th^2 = 5 > 2.8
  EXPECT_EQ(dynamic_count(two_depths(5, 2)), 0);   // th^2 = 2.5
  EXPECT_EQ(dynamic_count(two_depths(17, 2)), 0);  // s = 8.5, so th^2 = 8.5 meets 9
  EXPECT_EQ(dynamic_count(two_depths(10, 1)), 1);  // s = 10, th^2 = 10 > 9
  EXPECT_EQ(depth_test(two_depths(5, 1)).back(), 1);
}

TEST(PaperFilter, TheMinorityIsDynamicEvenWhenItIsTheBackground) {
  std::vector<double> person_filling_the_box(30, 1.5);
  person_filling_the_box.insert(person_filling_the_box.end(), 5, 4.0);  // th^2 = 6, s = 6
  const auto verdict = depth_test(person_filling_the_box);
  EXPECT_EQ(verdict.front(), 0);
  EXPECT_EQ(verdict.back(), 1);
}

TEST(PaperFilter, FewOrEqualDepthsSayNothing) {
  EXPECT_FALSE(depth_spread(std::vector<double>{1, 1, 1, 9}).usable);
  EXPECT_FALSE(depth_spread(std::vector<double>(20, 2.0)).usable);
  EXPECT_FALSE(depth_spread({}).usable);
  EXPECT_EQ(dynamic_count({1, 1, 1, 9}), 0);
  EXPECT_EQ(dynamic_count(std::vector<double>(20, 2.0)), 0);
  EXPECT_TRUE(depth_test({}).empty());
}

}  // namespace
}  // namespace dkb
