// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/assignment.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "dkb/util/random.h"

namespace dkb {
namespace {

double total(const Eigen::MatrixXd& cost, const std::vector<int>& column_of, double unassigned) {
  double sum = 0;
  for (Eigen::Index r = 0; r < cost.rows(); ++r) {
    const int c = column_of[static_cast<size_t>(r)];
    sum += c < 0 ? unassigned : cost(r, c);
  }
  return sum;
}

// The oracle: every way to give rows columns or none.
double min_total(const Eigen::MatrixXd& cost, double unassigned, Eigen::Index row, unsigned used) {
  if (row == cost.rows()) return 0;
  double best = unassigned + min_total(cost, unassigned, row + 1, used);
  for (Eigen::Index c = 0; c < cost.cols(); ++c)
    if ((used >> c & 1u) == 0)
      best = std::min(best, cost(row, c) + min_total(cost, unassigned, row + 1, used | 1u << c));
  return best;
}

TEST(Assignment, TheTotalCountsNotTheSinglePair) {
  Eigen::MatrixXd cost(2, 2);
  cost << 1, 2, 3, 9;  // greedy: 1 + 9; best: 2 + 3
  EXPECT_EQ(assign(cost, 100), (std::vector<int>{1, 0}));
}

TEST(Assignment, WhatCostsTooMuchIsLeftOut) {
  Eigen::MatrixXd cost(2, 1);
  cost << 5, 4;
  EXPECT_EQ(assign(cost, 10), (std::vector<int>{-1, 0}));
  EXPECT_EQ(assign(cost, 4), (std::vector<int>{-1, -1}));
}

TEST(Assignment, NothingToAssignIsNoError) {
  EXPECT_TRUE(assign(Eigen::MatrixXd(0, 3), 1).empty());
  EXPECT_EQ(assign(Eigen::MatrixXd(2, 0), 1), (std::vector<int>{-1, -1}));
}

TEST(Assignment, CostsAsLittleAsTheBestOfAllWays) {
  Random random(5);
  for (int i = 0; i < 300; ++i) {
    const auto rows = static_cast<Eigen::Index>(1 + random.below(5)),
               columns = static_cast<Eigen::Index>(1 + random.below(5));
    Eigen::MatrixXd cost(rows, columns);
    for (Eigen::Index k = 0; k < cost.size(); ++k) cost.data()[k] = random.uniform(0, 10);
    const double unassigned = random.uniform(2, 12);
    const std::vector<int> found = assign(cost, unassigned);
    EXPECT_NEAR(total(cost, found, unassigned), min_total(cost, unassigned, 0, 0), 1e-9);
    std::vector<int> taken;
    for (int c : found)
      if (c >= 0) taken.push_back(c);
    std::sort(taken.begin(), taken.end());
    EXPECT_EQ(std::adjacent_find(taken.begin(), taken.end()), taken.end());
  }
}

}  // namespace
}  // namespace dkb
