// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/features/simd.h"
#include "dkb/image/image.h"

namespace dkb {

// Corner on the pixel grid of one image.
struct PixelCorner {
  uint16_t x = 0, y = 0;  // [px]
  uint8_t score = 0;      // largest threshold at which the pixel is still a corner
  bool operator==(const PixelCorner&) const = default;
};

inline constexpr int kFastRadius = 3;  // [px] of the circle about a corner

// FAST-9 corners with non-maximum suppression (Rosten and Drummond, ECCV 2006; Rosten, Porter, Drummond, PAMI 2010).
// A pixel is a corner at threshold t if 9 consecutive pixels of the 16 on the circle of radius 3 about it are all
// brighter than it by more than t, or all darker. The score is computed for whole rows at once as the best over arcs of
// the weakest contrast within the arc, so that one pass serves every threshold from the smallest up.
class FastCornerFinder {
 public:
  explicit FastCornerFinder(Simd simd = best_simd()) : simd_(simd) {}

  // Replaces `corners` by those with a score >= threshold (>= 1) that exceed the score of their 8 neighbours, at
  // least `border` [px] (>= 3) away from the edge of the image, in row-major order.
  void find(const GreyImage& image, int threshold, int border, std::vector<PixelCorner>& corners);

 private:
  Simd simd_;
  std::vector<uint8_t> scores_;   // three padded rows
  std::vector<PixelCorner> row_;  // of one row, with room to spare
};

// FAST-9 contrasts (score + 1; 0 if the pixel is no corner at any threshold) of the 5 x 5 pixels about (x, y),
// row-major. (x, y) must be at least 5 px from the image's edge.
void fast_contrasts_5x5(const GreyImage& image, int x, int y, uint8_t (&contrasts)[25], Simd simd = best_simd());

}  // namespace dkb
