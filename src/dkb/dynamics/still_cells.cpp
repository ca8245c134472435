// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/still_cells.h"

namespace dkb {

Silhouettes without_still(Silhouettes boxed, const StillCells& still) {
  MoverMask& mask = boxed.mask;
  const std::vector<int> columns = rows_at_middle(mask.cells.width(), mask.cell, still.cell);
  for (int y = 0; y < mask.cells.height(); ++y) {
    const int v = row_at_middle(y, mask.cell, still.cell);
    if (v >= still.kinds.height()) break;
    uint8_t* const marked = mask.cells.row(y);
    uint8_t* const body = boxed.body.cells.row(y);
    const uint8_t* const kinds = still.kinds.row(v);
    for (size_t x = 0; x < columns.size(); ++x) {
      if (marked[x] == 0 || columns[x] >= still.kinds.width()) continue;
      if (kinds[columns[x]] >= (body[x] != 0 ? StillCells::witnessed : StillCells::unrefuted)) marked[x] = body[x] = 0;
    }
  }
  return boxed;
}

}  // namespace dkb
