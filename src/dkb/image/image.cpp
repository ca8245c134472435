// SPDX-License-Identifier: Apache-2.0
#include "dkb/image/image.h"

namespace dkb {

GreyImage grey_from_colour(const ColourImage& colour) {
  GreyImage grey(colour.width(), colour.height());
  const Rgb* in = colour.data();
  uint8_t* out = grey.data();
  const size_t n = colour.size();
  for (size_t i = 0; i < n; ++i)
    out[i] = static_cast<uint8_t>((4899u * in[i].r + 9617u * in[i].g + 1868u * in[i].b + 8192u) >> 14);
  return grey;
}

}  // namespace dkb
