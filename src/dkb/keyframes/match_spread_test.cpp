// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/match_spread.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb {
namespace {

TEST(SpreadGrid, CountsByCellAndRim) {
  const SpreadGrid grid =
      spread_grid({{0, 0}, {299, 0}, {300, 0}, {899, 599}, {900, 600}, {-5, 450}, {450, 250}}, 900, 600);
  EXPECT_EQ(grid, (SpreadGrid{{{2, 1, 0}, {0, 1, 0}, {1, 0, 2}}}));
  EXPECT_EQ(count_of(grid), 7);
}

TEST(CentreOfGravityBalance, GrowsWithDistanceAndEquality) {  // DKB eq. 38
  // Opposite corners: D = 2 sqrt(2), so ECOG = 5 / 10.
  EXPECT_NEAR(centre_of_gravity_balance({{{10, 0, 0}, {0, 1, 0}, {0, 0, 5}}}), 0.5, 1e-12);
  // Neighbours: D = 1, ECOG = 8 / (2 sqrt(2) 10).
  EXPECT_NEAR(centre_of_gravity_balance({{{10, 8, 0}, {0, 0, 0}, {0, 0, 5}}}), 0.8 / (2 * std::sqrt(2.0)), 1e-12);
  // The fuller cell comes second in row-major order: D = sqrt(1 + 4).
  EXPECT_NEAR(centre_of_gravity_balance({{{6, 0, 0}, {0, 0, 9}, {0, 0, 0}}}),
              std::sqrt(5.0) * 6 / (2 * std::sqrt(2.0) * 9), 1e-12);
}

TEST(CentreOfGravityBalance, TakesTheFirstOfEqualCells) {
  // Cells (0,0), (0,1) and (2,2) hold 4 each: the first two count, D = 1.
  EXPECT_NEAR(centre_of_gravity_balance({{{4, 4, 0}, {0, 0, 0}, {0, 0, 4}}}), 1 / (2 * std::sqrt(2.0)), 1e-12);
}

TEST(CentreOfGravityBalance, IsZeroForOneFullCellAndForNone) {
  EXPECT_EQ(centre_of_gravity_balance({{{0, 0, 0}, {0, 0, 0}, {0, 0, 7}}}), 0);
  EXPECT_EQ(centre_of_gravity_balance({}), 0);
}

TEST(CentreOfGravityOffset, IsTheOffsetFromTheMiddle) {  // DKB eqs. 39-41
  // Rows 1 2 3 / 0 1 0 / 0 1 4, sum 12: (5 - 6) / 12 down, (7 - 1) / 12 to the right.
  EXPECT_NEAR(centre_of_gravity_offset({{{1, 2, 3}, {0, 1, 0}, {0, 1, 4}}}), std::sqrt(1.0 + 36.0) / 12, 1e-12);
  EXPECT_NEAR(centre_of_gravity_offset({{{5, 0, 0}, {0, 0, 0}, {0, 0, 0}}}), std::sqrt(2.0), 1e-12);
  EXPECT_EQ(centre_of_gravity_offset({{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}}), 0);
  EXPECT_EQ(centre_of_gravity_offset({}), 0);
}

TEST(SpreadVote, IsForAKeyframeWhileTheMatchesAreBalanced) {
  EXPECT_TRUE(vote_by_spread({{{9, 1, 1}, {1, 1, 1}, {1, 1, 9}}}).votes);   // 1 against 0
  EXPECT_FALSE(vote_by_spread({{{9, 1, 0}, {8, 1, 0}, {7, 1, 0}}}).votes);  // 0.31 against 0.89
  EXPECT_FALSE(vote_by_spread({{{0, 0, 0}, {0, 7, 0}, {0, 0, 0}}}).votes);  // one full cell: 0 against 0
  EXPECT_FALSE(vote_by_spread({}).votes);
}

}  // namespace
}  // namespace dkb
