// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_mask.h"
#include <gtest/gtest.h>

namespace dkb {
namespace {

MoverMask one_cell(int columns, int rows, int x, int y, int cell = 4) {
  MoverMask mask{cell, Image<uint8_t>(columns, rows)};
  mask.cells(x, y) = 255;
  return mask;
}

int marked(const MoverMask& mask) {
  int count = 0;
  for (size_t i = 0; i < mask.cells.size(); ++i) count += mask.cells.data()[i] != 0;
  return count;
}

TEST(MoverMask, ACellCoversItsSquareOfPixels) {
  const MoverMask mask = one_cell(10, 10, 2, 3);
  EXPECT_TRUE(mask.at(8, 12));
  EXPECT_TRUE(mask.at(11.9f, 15.9f));
  EXPECT_FALSE(mask.at(7.9f, 12));
  EXPECT_FALSE(mask.at(8, 16));
  EXPECT_FALSE(mask.at(400, 12));
}

TEST(MoverMask, NothingIsMarkedLeftOfOrAboveTheImage) {
  const MoverMask mask = one_cell(10, 10, 0, 0);
  EXPECT_TRUE(mask.at(0, 0));
  EXPECT_FALSE(mask.at(-0.5f, 0));
  EXPECT_FALSE(mask.at(0, -3));
}

TEST(MoverMask, AnEmptyMaskMarksNothing) {
  MoverMask mask;
  EXPECT_TRUE(mask.empty());
  EXPECT_FALSE(mask.at(0, 0));
  dilate(mask, 3);
  EXPECT_TRUE(mask.empty());
}

TEST(MoverMask, UnitingMarksWhatEitherMarks) {
  MoverMask mask = one_cell(10, 10, 0, 0);
  unite(mask, one_cell(10, 10, 9, 9), 40, 40);
  EXPECT_EQ(marked(mask), 2);
  EXPECT_NE(mask.cells(9, 9), 0);
}

TEST(MoverMask, CellsOfAnotherSizeAreResampled) {
  MoverMask mask = one_cell(10, 10, 9, 9);
  unite(mask, one_cell(5, 5, 1, 0, 8), 40, 40);  // pixels 8 ... 15, 0 ... 7: cells 2, 3 of rows 0, 1
  EXPECT_EQ(marked(mask), 5);
  for (const auto& [x, y] : {std::pair{2, 0}, {3, 0}, {2, 1}, {3, 1}}) EXPECT_NE(mask.cells(x, y), 0);
}

TEST(MoverMask, UnitingIntoNothingTakesTheImagesSize) {
  MoverMask mask;
  unite(mask, one_cell(21, 11, 20, 10), 82, 41);  // the last cells reach beyond the image
  EXPECT_EQ(mask.cells.width(), 21);
  EXPECT_EQ(mask.cells.height(), 11);
  EXPECT_EQ(marked(mask), 1);
  unite(mask, MoverMask(), 82, 41);
  EXPECT_EQ(marked(mask), 1);
}

TEST(MoverMask, DilationGrowsInAllEightDirections) {
  MoverMask mask = one_cell(10, 10, 5, 5);
  dilate(mask, 2);
  EXPECT_EQ(marked(mask), 25);
  EXPECT_NE(mask.cells(3, 3), 0);
  EXPECT_EQ(mask.cells(2, 5), 0);
}

TEST(MoverMask, DilationStopsAtTheBorder) {
  MoverMask mask = one_cell(10, 10, 0, 9);
  dilate(mask, 1);
  EXPECT_EQ(marked(mask), 4);
  dilate(mask, 0);
  EXPECT_EQ(marked(mask), 4);
}

TEST(MoverMask, ErosionUndoesDilationAndTakesWhatIsOutsideForMarked) {
  MoverMask mask = one_cell(10, 10, 5, 5);
  dilate(mask, 2);
  erode(mask, 2);
  EXPECT_EQ(marked(mask), 1);
  EXPECT_NE(mask.cells(5, 5), 0);
  erode(mask, 1);
  EXPECT_EQ(marked(mask), 0);
  MoverMask corner = one_cell(10, 10, 0, 9);
  dilate(corner, 2);
  erode(corner, 2);
  EXPECT_EQ(marked(corner), 1);
}

}  // namespace
}  // namespace dkb
