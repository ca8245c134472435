// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/still_cells.h"

namespace dkb {

Silhouettes without_still(Silhouettes boxed, const StillCells& still) {
  MoverMask& mask = boxed.mask;
  const auto seen_at = [&](int v) { return (v * mask.cell + mask.cell / 2) / still.cell; };
  for (int y = 0; y < mask.cells.height(); ++y) {
    const int v = seen_at(y);
    for (int x = 0; x < mask.cells.width(); ++x) {
      if (mask.cells(x, y) == 0) continue;
      const int u = seen_at(x);
      if (!still.kinds.contains(u, v)) continue;
      uint8_t& body = boxed.body.cells(x, y);
      if (still.kinds(u, v) >= (body != 0 ? StillCells::witnessed : StillCells::unrefuted)) mask.cells(x, y) = body = 0;
    }
  }
  return boxed;
}

}  // namespace dkb
