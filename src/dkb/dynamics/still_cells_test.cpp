// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/still_cells.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

// A row of four mask cells of 4 px, the last two of them of the body.
Silhouettes boxed_row() {
  Silhouettes boxed;
  boxed.mask.cell = boxed.body.cell = 4;
  boxed.mask.cells = Image<uint8_t>(4, 1, 255);
  boxed.body.cells = Image<uint8_t>(4, 1);
  boxed.body.cells(2, 0) = boxed.body.cells(3, 0) = 255;
  return boxed;
}

TEST(StillCells, OfABodyOnlyWhatAViewWitnessedIsTakenOut) {
  StillCells still{4, Image<uint8_t>(4, 1)};
  still.kinds(1, 0) = still.kinds(2, 0) = StillCells::unrefuted;
  still.kinds(3, 0) = StillCells::witnessed;
  const Silhouettes left = without_still(boxed_row(), still);
  EXPECT_NE(left.mask.cells(0, 0), 0) << "it moves, or nobody knows";
  EXPECT_EQ(left.mask.cells(1, 0), 0) << "beside the body nothing speaks for motion";
  EXPECT_NE(left.mask.cells(2, 0), 0);
  EXPECT_NE(left.body.cells(2, 0), 0);
  EXPECT_EQ(left.mask.cells(3, 0), 0);
  EXPECT_EQ(left.body.cells(3, 0), 0);
}

TEST(StillCells, CellsOfAnotherSizeCountWhereTheyLie) {
  StillCells still{8, Image<uint8_t>(2, 1)};
  still.kinds(0, 0) = StillCells::witnessed;
  const Silhouettes left = without_still(boxed_row(), still);
  for (int x = 0; x < 4; ++x) EXPECT_EQ(left.mask.cells(x, 0) == 0, x < 2) << x;
}

TEST(StillCells, NothingIsKnownWithoutMotionSegmentation) {
  EXPECT_EQ(without_still(boxed_row(), {}).mask.cells, boxed_row().mask.cells);
}

}  // namespace
}  // namespace dkb
