// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace dkb {

// Flat grid over points of an image: which lie near a place? Points outside the image count to the cells at its rim.
class KeypointGrid {
 public:
  KeypointGrid() = default;
  // Of points with a `pixel`.
  template <class Points>
  KeypointGrid(const Points& points, int width, int height) : columns_(width / kCell + 1), rows_(height / kCell + 1) {
    first_.assign(static_cast<size_t>(columns_ * rows_) + 1, 0);
    for (const auto& p : points) ++first_[cell(p.pixel.x(), p.pixel.y()) + 1];
    for (size_t c = 1; c < first_.size(); ++c) first_[c] += first_[c - 1];
    points_.resize(points.size());
    std::vector<int32_t> next(first_.begin(), first_.end() - 1);
    int32_t index = 0;
    for (const auto& p : points)
      points_[static_cast<size_t>(next[cell(p.pixel.x(), p.pixel.y())]++)] = {p.pixel.x(), p.pixel.y(), index++};
  }

  // Calls visit(i) for every point within `radius` (in both x and y) of (x, y), cell by cell in row-major order, by
  // increasing index within a cell.
  template <class Visit>
  void for_each_near(float x, float y, float radius, Visit&& visit) const {
    if (points_.empty()) return;
    const int c0 = column(x - radius), c1 = column(x + radius), r0 = row(y - radius), r1 = row(y + radius);
    for (int r = r0; r <= r1; ++r) {
      const auto from = static_cast<size_t>(first_[static_cast<size_t>(r * columns_ + c0)]);
      const auto to = static_cast<size_t>(first_[static_cast<size_t>(r * columns_ + c1) + 1]);
      for (size_t k = from; k < to; ++k) {
        const float dx = points_[k].x - x, dy = points_[k].y - y;
        if ((dx <= radius) & (dx >= -radius) & (dy <= radius) & (dy >= -radius)) visit(points_[k].index);
      }
    }
  }

 private:
  static constexpr int kCell = 16;  // [px]
  int column(float x) const { return std::clamp(static_cast<int>(x) / kCell, 0, columns_ - 1); }
  int row(float y) const { return std::clamp(static_cast<int>(y) / kCell, 0, rows_ - 1); }
  size_t cell(float x, float y) const { return static_cast<size_t>(row(y) * columns_ + column(x)); }

  struct Point {
    float x, y;
    int32_t index;
  };
  int columns_ = 0, rows_ = 0;
  std::vector<int32_t> first_;  // point of each cell
  std::vector<Point> points_;   // by cells
};

}  // namespace dkb
