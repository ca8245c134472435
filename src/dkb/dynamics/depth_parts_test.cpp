// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/depth_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/util/random.h"

namespace dkb {
namespace {

using Cells = std::vector<uint32_t>;

TEST(DepthParts, StepsInDepthAndHolesDivide) {
  // A step of 10%, then a hole; the row below joins the two sides of the hole.
  const std::vector<float> depth = {
      1, 1, 1.1F, 0,    1.1F,  //
      0, 0, 1.1F, 1.1F, 1.1F,
  };
  const auto parts = DepthParts(5, 2).find(depth, 0.05F);
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].cells, (Cells{0, 1}));
  EXPECT_EQ(parts[1].cells, (Cells{2, 4, 7, 8, 9}));
  const CellBounds& b = parts[1].bounds;
  EXPECT_EQ((std::array{b.x0, b.y0, b.x1, b.y1}), (std::array{2, 0, 5, 2}));
}

TEST(DepthParts, NothingWhereThereIsNoDepth) {
  EXPECT_TRUE(DepthParts(4, 3).find(std::vector<float>(12, 0), 0.05F).empty());
}

TEST(DepthParts, ACellIsInnerIfAllItsNeighboursAreLinked) {
  // All of a block that ends with the grid, but for the column and the row that end before it.
  std::vector<float> depth(5 * 4, 0);
  for (const size_t i : {0, 1, 2, 5, 6, 7, 10, 11, 12}) depth[i] = 2;
  const auto parts = DepthParts(5, 4).find(depth, 0.05F);
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].inner, 4u);
  EXPECT_EQ(DepthParts(3, 3).find(std::vector<float>(9, 1), 0.05F)[0].inner, 9u) << "outside counts as linked";
}

TEST(LinkCells, TheNearerOfTwoCellsTellsHowFarApartTheyMayBe) {
  const std::vector<float> depth = {1, 1.2F, 1, 1.2F, 0, 1}, jump = {0.3F, 0.1F, 0.1F, 0.3F, 1, 1};
  for (const Simd simd : {Simd::scalar, best_simd()}) {
    std::vector<uint8_t> linked(6, 7);
    link_cells(depth, jump, 1, linked.data(), simd);
    EXPECT_EQ(linked, (std::vector<uint8_t>{1, 0, 0, 0, 0, 7}));
    link_cells(depth, jump, 2, linked.data(), simd);
    EXPECT_EQ(linked, (std::vector<uint8_t>{1, 1, 0, 1, 0, 7}));
    link_cells(depth, jump, 6, linked.data(), simd);  // there is no such neighbour
    EXPECT_EQ(linked, (std::vector<uint8_t>{1, 1, 0, 1, 0, 7}));
  }
}

// The same by a search from neighbour to neighbour.
std::vector<Cells> flooded(const std::vector<float>& depth, int columns, int rows, float jump) {
  std::vector<bool> seen(depth.size(), false);
  std::vector<Cells> parts;
  for (uint32_t seed = 0; seed < depth.size(); ++seed) {
    if (seen[seed] || !(depth[seed] > 0)) continue;
    Cells cells{seed};
    seen[seed] = true;
    for (size_t k = 0; k < cells.size(); ++k) {
      const int x = static_cast<int>(cells[k]) % columns, y = static_cast<int>(cells[k]) / columns;
      const float d = depth[cells[k]];
      for (const auto& [u, v] : {std::pair{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}) {
        if (u < 0 || v < 0 || u >= columns || v >= rows) continue;
        const auto j = static_cast<uint32_t>(v * columns + u);
        const float low = std::min(d, depth[j]);
        if (seen[j] || !(low > 0) || std::max(d, depth[j]) - low > jump * low) continue;
        seen[j] = true;
        cells.push_back(j);
      }
    }
    std::sort(cells.begin(), cells.end());
    parts.push_back(cells);
  }
  return parts;
}

TEST(DepthParts, AsBySearchFromNeighbourToNeighbourWithEachInstructionSet) {
  Random random(7);
  for (int round = 0; round < 200; ++round) {
    const int columns = 1 + static_cast<int>(random.uniform() * 40), rows = 1 + static_cast<int>(random.uniform() * 30);
    std::vector<float> depth;
    const double share = random.uniform();
    for (int i = 0; i < columns * rows; ++i)
      depth.push_back(random.uniform() < share ? static_cast<float>(1 + 0.06 * std::floor(3 * random.uniform())) : 0);
    const auto expected = flooded(depth, columns, rows, 0.07F);
    for (const Simd simd : {Simd::scalar, best_simd()}) {
      DepthParts parts(columns, rows, simd);
      for (int again = 0; again < 2; ++again) {
        const auto found = parts.find(depth, 0.07F);
        ASSERT_EQ(found.size(), expected.size());
        for (size_t p = 0; p < found.size(); ++p) ASSERT_EQ(found[p].cells, expected[p]);
      }
    }
  }
}

}  // namespace
}  // namespace dkb
