// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/still_cells.h"

namespace dkb {

Silhouettes without_still(Silhouettes boxed, const StillCells& still) {
  MoverMask& mask = boxed.mask;
  for (int y = 0; y < mask.cells.height(); ++y) {
    const int v = row_at_middle(y, mask.cell, still.cell);
    for (int x = 0; x < mask.cells.width(); ++x) {
      if (mask.cells(x, y) == 0) continue;
      const int u = row_at_middle(x, mask.cell, still.cell);
      if (!still.kinds.contains(u, v)) continue;
      uint8_t& body = boxed.body.cells(x, y);
      if (still.kinds(u, v) >= (body != 0 ? StillCells::witnessed : StillCells::unrefuted)) mask.cells(x, y) = body = 0;
    }
  }
  return boxed;
}

}  // namespace dkb
