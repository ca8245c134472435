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

MoverMask spread_into_holes(const MoverMask& mask, const DepthImage& depth, double max_distance, double focal) {
  MoverMask spread = mask;
  if (mask.empty()) return spread;
  const int cell = mask.cell, width = mask.cells.width(), height = mask.cells.height();
  const auto at = [&](int x, int y) -> const float& {
    return depth(std::min(depth.width() - 1, x * cell + cell / 2), std::min(depth.height() - 1, y * cell + cell / 2));
  };
  struct Step {
    int x, y;
    float left;  // [cells]
  };
  std::vector<Step> front;
  std::vector<std::pair<int, int>> rim;
  const auto per_metre = static_cast<float>(focal / cell);
  constexpr std::array<std::pair<int, int>, 4> kBeside{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};
  const auto open = [&](int u, int v) {
    return spread.cells.contains(u, v) && spread.cells(u, v) == 0 && !(at(u, v) > 0);
  };
  for (int y = 0; y < height; ++y) {
    const uint8_t* const here = mask.cells.row(y);
    const uint8_t* const above = mask.cells.row(std::max(0, y - 1));
    const uint8_t* const below = mask.cells.row(std::min(height - 1, y + 1));
    for (int x = 0; x < width; ++x) {
      if (here[x] == 0) continue;
      const bool inside =
          (here[std::max(0, x - 1)] != 0) & (here[std::min(width - 1, x + 1)] != 0) & (above[x] != 0) & (below[x] != 0);
      if (inside) continue;
      rim.push_back({x, y});
      for (int v = std::max(0, y - 1); v <= std::min(height - 1, y + 1); ++v) __builtin_prefetch(&at(x, v));
    }
  }
  for (const auto& [x, y] : rim) {
    const bool at_hole = std::any_of(kBeside.begin(), kBeside.end(), [&, u = x, v = y](const auto& step) {
      return open(u + step.first, v + step.second);
    });
    if (const float z = at(x, y); at_hole && z > 0)
      front.push_back({x, y, static_cast<float>(max_distance) * per_metre / z});
  }
  for (size_t k = 0; k < front.size(); ++k) {
    const auto [x, y, left] = front[k];
    if (left < 1) continue;
    for (const auto& [dx, dy] : kBeside) {
      if (!open(x + dx, y + dy)) continue;
      spread.cells(x + dx, y + dy) = 255;
      front.push_back({x + dx, y + dy, left - 1});
    }
  }
  return spread;
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

void erode(MoverMask& mask, int radius) {
  const auto invert = [&] {
    for (size_t i = 0; i < mask.cells.size(); ++i) mask.cells.data()[i] = mask.cells.data()[i] != 0 ? 0 : 255;
  };
  invert();
  dilate(mask, radius);
  invert();
}

}  // namespace dkb
