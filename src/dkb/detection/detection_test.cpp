// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detection.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace dkb {
namespace {

TEST(Box, ClippingKeepsThePartInTheImage) {
  EXPECT_EQ(clip({-10, 5, 30, 20}, 100, 20), (Box{0, 5, 20, 15}));
  EXPECT_EQ(clip({10, 5, 30, 10}, 100, 20), (Box{10, 5, 30, 10}));
  EXPECT_EQ(clip({120, 5, 30, 10}, 100, 20).w, 0);
  EXPECT_EQ(clip({-50, 5, 30, 10}, 100, 20).w, 0);
}

TEST(Box, IntersectionOverUnionIsTheSharedPart) {
  EXPECT_FLOAT_EQ(intersection_over_union({0, 0, 10, 10}, {5, 0, 10, 10}), 1.0f / 3);  // 50 / 150
  EXPECT_EQ(intersection_over_union({0, 0, 10, 10}, {0, 0, 10, 10}), 1);
  EXPECT_EQ(intersection_over_union({0, 0, 10, 10}, {10, 0, 10, 10}), 0);
  EXPECT_EQ(intersection_over_union({0, 0, 0, 0}, {0, 0, 0, 0}), 0);
}

TEST(Box, PixelsAreThoseThatItHolds) {
  for (const Box& box : {Box{2, 1, 3, 2},
                         {1.5f, 0.25f, 2.5f, 3},
                         {-4, -4, 6.5f, 5},
                         {7, 4, 30, 30},
                         {20, 20, 3, 3},
                         {-3e30f, 0, 6e30f, 1},
                         {3e30f, 0, 1, 1},
                         {3, 3, 0, 2}}) {
    std::vector<std::pair<int, int>> held, visited;
    for (int y = 0; y < 6; ++y)
      for (int x = 0; x < 9; ++x)
        if (box.contains(static_cast<float>(x), static_cast<float>(y))) held.emplace_back(x, y);
    for_each_pixel(box, 9, 6, [&](int x, int y) { visited.emplace_back(x, y); });
    EXPECT_EQ(visited, held) << box.x << " " << box.y;
  }
}

}  // namespace
}  // namespace dkb
