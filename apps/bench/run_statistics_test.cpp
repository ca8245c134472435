// SPDX-License-Identifier: Apache-2.0
#include "bench/run_statistics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

TEST(Median, IsTheMiddleOrTheMeanOfTheTwoMiddleOnes) {
  EXPECT_EQ(median_of({3, 1, 2}), 2);
  EXPECT_EQ(median_of({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(median_of({7}), 7);
  EXPECT_TRUE(std::isnan(median_of({})));
}

// P(median of a resample is the smallest of 5) = P(3 or more of 5 draws hit it), p = 1/5:
// 10 * .008 * .64 + 5 * .0016 * .8 + .00032 = .0579 > .025, so the interval begins there; likewise at the top.
TEST(MedianInterval, OfFiveValuesReachesFromTheSmallestToTheLargest) {
  const MedianInterval m = median_interval({5, 1, 4, 2, 3});
  EXPECT_TRUE(m.known);
  EXPECT_EQ(m.median, 3);
  EXPECT_EQ(m.interval.low, 1);
  EXPECT_EQ(m.interval.high, 5);
}

// Of 7: P(4 or more of 7 draws hit the smallest), p = 1/7: .00918 + .00092 + .00005 = .0102 < .025, while at most the
// second smallest has p = 2/7: .1024: the interval is from the second to the last but one.
TEST(MedianInterval, OfSevenValuesLeavesOutTheExtremes) {
  const MedianInterval m = median_interval({10, 20, 30, 40, 50, 60, 1000});
  EXPECT_EQ(m.median, 40);
  EXPECT_EQ(m.interval.low, 20);
  EXPECT_EQ(m.interval.high, 60);
}

TEST(MedianInterval, SaysNothingOfFewerThanFiveValues) {
  EXPECT_FALSE(median_interval({1, 2, 3, 4}).known);
  EXPECT_EQ(median_interval({1, 2, 3, 4}).median, 2.5);
  EXPECT_FALSE(median_interval({}).known);
}

TEST(MedianInterval, OfEqualValuesHasNoWidth) {
  const MedianInterval m = median_interval({2, 2, 2, 2, 2, 2});
  EXPECT_EQ(m.interval.low, 2);
  EXPECT_EQ(m.interval.high, 2);
}

TEST(MedianInterval, IsAFunctionOfTheValues) {
  const std::vector<double> values = {.1, .5, .22, .31, .9, .43, .27, .66};
  const MedianInterval a = median_interval(values), b = median_interval(values);
  EXPECT_EQ(a.interval.low, b.interval.low);
  EXPECT_EQ(a.interval.high, b.interval.high);
}

// Ratios 1/2 and 2 on two sequences: their geometric mean is 1; without spread the interval has no width.
TEST(MeanRatio, IsGeometric) {
  const std::vector<double> one(5, 1.0), two(5, 2.0);
  const MedianInterval m = mean_ratio({{one, two}, {two, one}});
  EXPECT_TRUE(m.known);
  EXPECT_DOUBLE_EQ(m.median, 1);
  EXPECT_DOUBLE_EQ(m.interval.low, 1);
  EXPECT_DOUBLE_EQ(m.interval.high, 1);
  EXPECT_DOUBLE_EQ(mean_ratio({{one, two}}).median, 0.5);
}

TEST(MeanRatio, DrawsTheSameSeedsForBoth) {  // so runs that differ by a factor alone leave no doubt about it
  const std::vector<double> reference = {1, 2, 3, 4, 50};
  std::vector<double> ours;
  for (const double r : reference) ours.push_back(0.8 * r);
  const MedianInterval m = mean_ratio({{ours, reference}});
  EXPECT_NEAR(m.interval.low, 0.8, 1e-12);
  EXPECT_NEAR(m.interval.high, 0.8, 1e-12);
}

TEST(MeanRatio, IsUnknownWithoutRuns) {
  EXPECT_FALSE(mean_ratio({}).known);
  EXPECT_FALSE(mean_ratio({{{1, 2}, {1, 2}}}).known);
  EXPECT_THROW(mean_ratio({{{1, 2}, {1}}}), InputError);
}

// Two treatments, always in the same order, in 5 blocks: of the 2^5 permutations two are as extreme, p = 1/16.
TEST(Friedman, AgreesWithCountingPermutations) {
  const std::vector<std::vector<double>> blocks(5, {1, 2});
  EXPECT_NEAR(friedman_p_value(blocks, 1), 1.0 / 16, 0.01);
}

// Three treatments in 3 blocks, always in the same order: 6 of 6^3 permutations have all blocks alike, p = 1/36.
TEST(Friedman, CountsRanksOfThreeTreatments) {
  const std::vector<std::vector<double>> blocks = {{1, 2, 3}, {10, 20, 30}, {.1, .2, .3}};
  EXPECT_NEAR(friedman_p_value(blocks, 1, 20000), 1.0 / 36, 0.005);
}

TEST(Friedman, EqualTreatmentsDoNotDiffer) {
  EXPECT_EQ(friedman_p_value({{2, 2, 2}, {1, 1, 1}, {5, 5, 5}}, 1), 1);
  EXPECT_EQ(friedman_p_value({{1, 2}}, 1), 1);
  EXPECT_THROW(friedman_p_value({{1, 2}, {1, 2, 3}}, 1), InputError);
}

}  // namespace
}  // namespace dkb
