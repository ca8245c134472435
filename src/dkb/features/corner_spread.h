// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "dkb/features/fast_corners.h"

namespace dkb {

// The part of an image that corners may lie in: x in [left, right), y in [top, bottom) [px].
struct CornerRegion {
  int left = 0, top = 0, right = 0, bottom = 0;
  int width() const { return right - left; }
  int height() const { return bottom - top; }
};

// Picks corners so that they cover an image evenly, the strongest of each place first. Deterministic: ties go to the
// corner that comes first. Buffers are kept between calls.
class CornerSpread {
 public:
  // Smaller cells spread more evenly, larger ones give corners that are found again more often. 8 gave the smallest
  // variance of poses between real frames (1: 8% more on static, 12% more on dynamic ones; 32: no better than 8).
  static constexpr int kCornersPerCell = 8;

  // Removes corners weaker than `strong` from every cell (about `cell_size` px) that has a corner of that strength, as
  // if each cell had been searched with the high threshold first and with the low one only in vain.
  void drop_weak(const CornerRegion& region, int strong, int cell_size, std::vector<PixelCorner>& corners);

  // Keeps at most `count` corners: the region is cut into about count / kCornersPerCell cells; every cell gives its
  // strongest corner, then its second strongest, and so on; of the last round the strongest are taken.
  // Survivors are ordered by cell (row-major), then by falling strength.
  void keep(const CornerRegion& region, int count, std::vector<PixelCorner>& corners);

 private:
  struct Grid {
    int columns = 0, rows = 0;
    size_t cells() const { return static_cast<size_t>(columns) * static_cast<size_t>(rows); }
  };
  // The cell of each corner, into cell_of_.
  void find_cells(const CornerRegion& region, Grid grid, const std::vector<PixelCorner>& corners);
  // Sorts the indices of corners by cell into order_; cell c has order_[starts_[c] ... starts_[c + 1]).
  void sort_into_cells(const CornerRegion& region, Grid grid, const std::vector<PixelCorner>& corners);

  std::vector<uint32_t> cell_of_, starts_, order_, taken_;
  std::vector<uint64_t> keys_;
  std::vector<std::pair<uint64_t, uint32_t>> last_round_;
  std::vector<PixelCorner> kept_;
};

}  // namespace dkb
