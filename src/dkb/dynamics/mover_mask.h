// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "dkb/image/image.h"

namespace dkb {

// Where in an image something moves, or may: square cells of `cell` px, 255 = mover. Empty = nothing known to move.
struct MoverMask {
  int cell = 4;  // [px]
  Image<uint8_t> cells;

  bool empty() const { return cells.empty(); }
  bool at(float image_x, float image_y) const {
    // Not by the cell alone: -3 / 4 is 0.
    if (cells.empty() || !(image_x >= 0 && image_y >= 0)) return false;
    const int x = static_cast<int>(image_x) / cell, y = static_cast<int>(image_y) / cell;
    return cells.contains(x, y) && cells(x, y) != 0;
  }
};

// Marks in `into` what `other` marks; an empty `into` takes its shape. Cells of `other` may be of another size.
void unite(MoverMask& into, const MoverMask& other, int width, int height);

// Grows the marked area by `radius` cells in all eight directions.
void dilate(MoverMask& mask, int radius);
// Shrinks it likewise; what lies outside the image counts as marked.
void erode(MoverMask& mask, int radius);

// `mask`, spread from where it has depth into what lacks depth and hangs together with it, over `max_distance` [m] of
// image at that depth; `focal` [px]. Black parts of movers have no depth, nor has the background right beside a mover.
MoverMask spread_into_holes(const MoverMask& mask, const DepthImage& depth, double max_distance, double focal);

}  // namespace dkb
