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

// Somebody at 2 m before a wall at 3 m, whose depth begins at x = 100 and whose outline shows at 98.
TEST(MoverMask, ACornerWithoutDepthOfItsOwnIsOnTheSurfaceThatLendsItOne) {
  CameraModel camera;
  camera.fx = camera.fy = 525;
  camera.cx = 79.5;
  camera.cy = 59.5;
  camera.width = 160;
  camera.height = 120;
  DepthImage depth(camera.width, camera.height, 3.0f);
  MoverMask mask{4, Image<uint8_t>(40, 30)};
  for (int y = 0; y < camera.height; ++y)
    for (int x = 100; x < camera.width; ++x) {
      depth(x, y) = 2;
      mask.cells(x / 4, y / 4) = 255;
    }
  const SensorNoise noise;
  const CornerDepths depths(depth, camera, noise);
  EXPECT_TRUE(is_on(mask, {102, 60}, depths));
  EXPECT_TRUE(is_on(mask, {98, 60}, depths));
  EXPECT_FALSE(is_on(mask, {94, 60}, depths));  // the wall's own
  // Where the wall is what is marked, somebody's outline is not.
  for (size_t i = 0; i < mask.cells.size(); ++i) mask.cells.data()[i] = mask.cells.data()[i] != 0 ? 0 : 255;
  EXPECT_FALSE(is_on(mask, {101, 60}, depths));
  for (int y = 0; y < camera.height; ++y) depth(101, y) = depth(100, y) = 0;  // his rim
  EXPECT_FALSE(is_on(mask, {101, 60}, depths));
  EXPECT_FALSE(is_on(MoverMask(), {101, 60}, depths));
}

}  // namespace
}  // namespace dkb
