// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/bayer.h"

namespace dkb {

ColourImage demosaiced(const uint8_t* mosaic, int width, int height, size_t stride, std::string_view pattern) {
  ColourImage image(width, height);
  // Mirrored at the border, where the pattern goes on like that.
  const auto mirrored = [](int i, int n) { return i < 0 ? -i : i >= n ? 2 * n - 2 - i : i; };
  const auto row_of = [&](int y) { return mosaic + static_cast<size_t>(mirrored(y, height)) * stride; };
  for (int y = 0; y < height; ++y) {
    const uint8_t *above = row_of(y - 1), *row = row_of(y), *below = row_of(y + 1);
    const std::string_view filters = pattern.substr(y % 2 == 0 ? 0 : 2, 2);
    const bool red_row = filters.find('r') != std::string_view::npos;
    Rgb* out = image.row(y);
    for (int x = 0; x < width; ++x) {
      const int l = mirrored(x - 1, width), r = mirrored(x + 1, width);
      const auto mean2 = [](int a, int b) { return static_cast<uint8_t>((a + b + 1) / 2); };
      const auto mean4 = [](int a, int b, int c, int d) { return static_cast<uint8_t>((a + b + c + d + 2) / 4); };
      if (filters[static_cast<size_t>(x % 2)] == 'g') {
        const uint8_t beside = mean2(row[l], row[r]), over = mean2(above[x], below[x]);
        out[x] = red_row ? Rgb{beside, row[x], over} : Rgb{over, row[x], beside};
      } else {
        const uint8_t green = mean4(row[l], row[r], above[x], below[x]),
                      far = mean4(above[l], above[r], below[l], below[r]);
        out[x] = red_row ? Rgb{row[x], green, far} : Rgb{far, green, row[x]};
      }
    }
  }
  return image;
}

}  // namespace dkb
