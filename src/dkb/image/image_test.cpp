// SPDX-License-Identifier: Apache-2.0
#include "dkb/image/image.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

TEST(Image, IsRowMajor) {
  Image<int> image(3, 2);
  image(2, 1) = 5;
  EXPECT_EQ(image.data()[5], 5);
  EXPECT_TRUE(image.contains(2, 1));
  EXPECT_FALSE(image.contains(3, 1));
}

TEST(GreyFromColour, UsesBt601Weights) {
  ColourImage colour(4, 1);
  colour(0, 0) = {255, 255, 255};
  colour(1, 0) = {255, 0, 0};
  colour(2, 0) = {0, 255, 0};
  colour(3, 0) = {0, 0, 255};
  const GreyImage grey = grey_from_colour(colour);
  EXPECT_EQ(grey(0, 0), 255);
  EXPECT_EQ(grey(1, 0), 76);   // 0.299 * 255 = 76.2
  EXPECT_EQ(grey(2, 0), 150);  // 0.587 * 255 = 149.7
  EXPECT_EQ(grey(3, 0), 29);   // 0.114 * 255 = 29.1
}

TEST(GreyFromColour, IsTheRoundedSumAtEverySize) {
  uint32_t state = 1;
  const auto any = [&state] { return static_cast<uint8_t>((state = state * 1664525 + 1013904223) >> 24); };
  for (int width = 1; width < 60; ++width) {
    ColourImage colour(width, 1);
    for (int x = 0; x < width; ++x) colour(x, 0) = {any(), any(), any()};
    const GreyImage grey = grey_from_colour(colour);
    for (int x = 0; x < width; ++x) {
      const auto [r, g, b] = colour(x, 0);
      EXPECT_EQ(grey(x, 0), (4899 * r + 9617 * g + 1868 * b + 8192) / 16384) << x << " of " << width;
    }
  }
}

}  // namespace
}  // namespace dkb
