// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_mask.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace dkb {

void unite(MoverMask& into, const MoverMask& other, int width, int height) {
  if (other.empty()) return;
  if (into.empty())
    into.cells = Image<uint8_t>((width + into.cell - 1) / into.cell, (height + into.cell - 1) / into.cell);
  if (into.cell == other.cell && into.cells.width() == other.cells.width() &&
      into.cells.height() == other.cells.height()) {
    for (size_t i = 0; i < into.cells.size(); ++i)
      into.cells.data()[i] = other.cells.data()[i] != 0 ? 255 : into.cells.data()[i];
    return;
  }
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
  // One direction after the other, by whole rows: the inner loops take many cells at a time.
  Image<uint8_t> rows(width, height);
  for (int y = 0; y < height; ++y)
    for (int d = -radius; d <= radius; ++d) {
      const uint8_t* from = mask.cells.row(y);
      uint8_t* to = rows.row(y);
      for (int x = std::max(0, -d); x < std::min(width, width - d); ++x) to[x] |= from[x + d];
    }
  std::fill(mask.cells.data(), mask.cells.data() + mask.cells.size(), uint8_t{0});
  for (int y = 0; y < height; ++y)
    for (int v = std::max(0, y - radius); v <= std::min(height - 1, y + radius); ++v) {
      const uint8_t* from = rows.row(v);
      uint8_t* to = mask.cells.row(y);
      for (int x = 0; x < width; ++x) to[x] |= from[x];
    }
}

bool is_on(const MoverMask& mask, const Eigen::Vector2f& corner, const CornerDepths& depths) {
  if (mask.at(corner.x(), corner.y())) return true;
  constexpr auto reach = static_cast<float>(CornerDepths::kReach);
  bool beside = false;
  for (const float v : {-reach, 0.0f, reach})
    for (const float u : {-reach, 0.0f, reach}) beside = beside || mask.at(corner.x() + u, corner.y() + v);
  if (!beside) return false;
  const CornerDepths::Depth depth = depths.at(corner.x(), corner.y());
  return depth.lent > 0 && mask.at(static_cast<float>(depth.lender.x()), static_cast<float>(depth.lender.y()));
}

}  // namespace dkb
