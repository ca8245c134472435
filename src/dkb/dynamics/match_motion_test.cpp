// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/match_motion.h"

#include <gtest/gtest.h>

#include <vector>

namespace dkb {
namespace {

constexpr int kCell = 4;

// Somebody 1 m away in columns 20 to 59 of 160 x 120 cells, before a wall 3 m away; a table at his depth right of him.
Image<float> depths() {
  Image<float> depth(160, 120, 3.0f);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) {
      if (x >= 20 && x < 60) depth(x, y) = 1.0f;
      if (x >= 80 && x < 140) depth(x, y) = 1.05f;
      if (y < 8) depth(x, y) = 0;
    }
  return depth;
}

std::vector<MatchMotion> matches() {
  std::vector<MatchMotion> found;
  for (float y = 40; y < 480; y += 40) {
    for (float x = 100; x < 240; x += 30) found.push_back({{x, y}, 1.0f, true});
    for (float x = 330; x < 560; x += 30) found.push_back({{x, y}, 1.05f, false});
    for (float x = 30; x < 640; x += 120) found.push_back({{x, y}, 3.0f, false});
  }
  return found;
}

TEST(MatchMotion, MovingCellsAreThoseOfWhoMovesAlone) {
  const MoverMask mask = moving_cells(depths(), kCell, matches());
  ASSERT_EQ(mask.cell, kCell);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 160; ++x) EXPECT_EQ(mask.cells(x, y) != 0, x >= 20 && x < 60 && y >= 8) << x << " " << y;
}

// A tenth of the image is 16 cells: no farther does a match speak.
TEST(MatchMotion, NobodySpeaksForWhatIsFarFromAllMatches) {
  const std::vector<MatchMotion> one{{{40.5f * kCell, 60.5f * kCell}, 1.0f, true}};
  const MoverMask mask = moving_cells(depths(), kCell, one);
  EXPECT_NE(mask.cells(40, 45), 0);
  EXPECT_EQ(mask.cells(40, 43), 0);
  EXPECT_EQ(mask.cells(90, 60), 0);
  const std::vector<MatchMotion> farther{{{40.5f * kCell, 60.5f * kCell}, 1.3f, true}};
  EXPECT_EQ(moving_cells(depths(), kCell, farther).cells(40, 60), 0) << "ln 1.3 is more than 0.2";
}

}  // namespace
}  // namespace dkb
