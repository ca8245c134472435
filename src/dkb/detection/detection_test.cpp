// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detection.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace dkb
