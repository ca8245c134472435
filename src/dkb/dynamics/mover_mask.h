// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/features/rgbd_features.h"
#include "dkb/image/image.h"

namespace dkb {

// Marks in `into` what `other` marks, whose cells may be of another size. An empty `into` keeps the size of its cells.
void unite(MoverMask& into, const MoverMask& other, int width, int height);

// Of two grids over one image, with cells of `from` and `to` px: the row or column of the second at the middle of row
// or column `i` of the first.
inline int row_at_middle(int i, int from, int to) {
  return (i * from + from / 2) / to;
}

// The same for the first `count` of them.
inline std::vector<int> rows_at_middle(int count, int from, int to) {
  std::vector<int> rows(static_cast<size_t>(count));
  for (int i = 0; i < count; ++i) rows[static_cast<size_t>(i)] = row_at_middle(i, from, to);
  return rows;
}

// Grows the marked area by `radius` cells in all eight directions.
void dilate(MoverMask& mask, int radius);

// Whether a corner [px] is on what is marked. One without a depth of its own is where the surface is that lends it one:
// the outline of a mover shows in the colour image a pixel or two beside its depth.
bool is_on(const MoverMask& mask, const Eigen::Vector2f& corner, const CornerDepths& depths);

}  // namespace dkb
