// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/corner_spread.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace dkb {

void CornerSpread::find_cells(const CornerRegion& region, Grid grid, const std::vector<PixelCorner>& corners) {
  cell_of_.resize(corners.size());
  // Cell of a pixel = (pixel - left) * columns / width, by a reciprocal with 32 binary places.
  const uint64_t step_x = (static_cast<uint64_t>(grid.columns) << 32) / static_cast<uint64_t>(region.width());
  const uint64_t step_y = (static_cast<uint64_t>(grid.rows) << 32) / static_cast<uint64_t>(region.height());
  for (size_t i = 0; i < corners.size(); ++i) {
    const uint64_t column = (static_cast<uint64_t>(corners[i].x - region.left) * step_x) >> 32;
    const uint64_t row = (static_cast<uint64_t>(corners[i].y - region.top) * step_y) >> 32;
    cell_of_[i] = static_cast<uint32_t>(row * static_cast<uint64_t>(grid.columns) + column);
  }
}

void CornerSpread::sort_into_cells(const CornerRegion& region, Grid grid, const std::vector<PixelCorner>& corners) {
  const size_t cells = grid.cells();
  find_cells(region, grid, corners);
  starts_.assign(cells + 1, 0);
  order_.resize(corners.size());
  for (const uint32_t cell : cell_of_) ++starts_[cell + 1];
  for (size_t c = 0; c < cells; ++c) starts_[c + 1] += starts_[c];
  // Fill each cell from its start; the starts move up by one cell and are moved back at the end.
  for (size_t i = 0; i < corners.size(); ++i) order_[starts_[cell_of_[i]]++] = static_cast<uint32_t>(i);
  for (size_t c = cells; c > 0; --c) starts_[c] = starts_[c - 1];
  starts_[0] = 0;
}

void CornerSpread::drop_weak(const CornerRegion& region, int strong, int cell_size, std::vector<PixelCorner>& corners) {
  if (corners.empty()) return;
  const Grid grid{std::max(1, region.width() / cell_size), std::max(1, region.height() / cell_size)};
  find_cells(region, grid, corners);
  taken_.assign(grid.cells(), 0);
  for (size_t i = 0; i < corners.size(); ++i)
    if (corners[i].score >= strong) taken_[cell_of_[i]] = 1;
  size_t kept = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    const PixelCorner corner = corners[i];
    corners[kept] = corner;
    kept += (corner.score >= strong) | (taken_[cell_of_[i]] == 0);
  }
  corners.resize(kept);
}

void CornerSpread::keep(const CornerRegion& region, int count, std::vector<PixelCorner>& corners) {
  if (static_cast<int>(corners.size()) <= count) return;
  if (count <= 0) return corners.clear();
  const double side = std::sqrt(static_cast<double>(region.width()) * region.height() * kCornersPerCell / count);
  const Grid grid{std::max(1, static_cast<int>(std::lround(region.width() / side))),
                  std::max(1, static_cast<int>(std::lround(region.height() / side)))};
  sort_into_cells(region, grid, corners);
  const size_t cells = starts_.size() - 1;

  // Strongest first; the earlier corner wins a tie, hence its complemented index in the low bits.
  keys_.resize(corners.size());
  for (size_t i = 0; i < corners.size(); ++i)
    keys_[i] = static_cast<uint64_t>(corners[order_[i]].score) << 32 | (0xFFFFFFFFu - order_[i]);
  const auto sort_all_cells = [&](uint32_t first, uint32_t end) {
    for (size_t c = 0; c < cells; ++c) {
      const auto from = keys_.begin() + std::min(starts_[c] + first, starts_[c + 1]);
      const auto to = keys_.begin() + starts_[c + 1];
      if (to - from > static_cast<ptrdiff_t>(end - first))
        std::partial_sort(from, from + (end - first), to, std::greater<>());
      else
        std::sort(from, to, std::greater<>());
    }
  };

  taken_.assign(cells, 0);
  size_t left = static_cast<size_t>(count);
  // No more are put in order than are looked at: most cells have several times as many as they give.
  uint32_t in_order = 0;
  for (uint32_t round = 0; left > 0; ++round) {
    if (round == in_order) {
      sort_all_cells(in_order, in_order + 2 * kCornersPerCell);
      in_order += 2 * kCornersPerCell;
    }
    last_round_.clear();
    for (size_t c = 0; c < cells; ++c)
      if (starts_[c] + round < starts_[c + 1])
        last_round_.emplace_back(keys_[starts_[c] + round], static_cast<uint32_t>(c));
    if (last_round_.size() > left) {
      std::nth_element(last_round_.begin(), last_round_.begin() + static_cast<ptrdiff_t>(left), last_round_.end(),
                       std::greater<>());
      last_round_.resize(left);
    }
    for (const auto& [key, cell] : last_round_) ++taken_[cell];
    left -= last_round_.size();
  }
  kept_.clear();
  for (size_t c = 0; c < cells; ++c)
    for (uint32_t i = 0; i < taken_[c]; ++i)
      kept_.push_back(corners[0xFFFFFFFFu - static_cast<uint32_t>(keys_[starts_[c] + i])]);
  corners.swap(kept_);
}

}  // namespace dkb
