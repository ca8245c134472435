// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_mask.h"

#include <algorithm>

namespace dkb {

void unite(MoverMask& into, const MoverMask& other, int width, int height) {
  if (other.empty()) return;
  if (into.empty())
    into.cells = Image<uint8_t>((width + into.cell - 1) / into.cell, (height + into.cell - 1) / into.cell);
  for (int y = 0; y < into.cells.height(); ++y)
    for (int x = 0; x < into.cells.width(); ++x) {
      const float centre_x = (static_cast<float>(x) + 0.5f) * static_cast<float>(into.cell);
      const float centre_y = (static_cast<float>(y) + 0.5f) * static_cast<float>(into.cell);
      if (other.at(centre_x, centre_y)) into.cells(x, y) = 255;
    }
}

void dilate(MoverMask& mask, int radius) {
  if (mask.empty() || radius <= 0) return;
  const int width = mask.cells.width(), height = mask.cells.height();
  Image<uint8_t> rows(width, height);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int d = std::max(0, x - radius); d <= std::min(width - 1, x + radius); ++d) rows(x, y) |= mask.cells(d, y);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      uint8_t any = 0;
      for (int d = std::max(0, y - radius); d <= std::min(height - 1, y + radius); ++d) any |= rows(x, d);
      mask.cells(x, y) = any;
    }
}

void erode(MoverMask& mask, int radius) {
  const auto invert = [&] {
    for (size_t i = 0; i < mask.cells.size(); ++i) mask.cells.data()[i] = mask.cells.data()[i] != 0 ? 0 : 255;
  };
  invert();
  dilate(mask, radius);
  invert();
}

}  // namespace dkb
