// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/subpixel.h"

#include <algorithm>

#include "dkb/features/fast_corners.h"

namespace dkb {

SubpixelOffset refine_corner(const GreyImage& image, int x, int y, Simd simd) {
  uint8_t contrasts[25];
  fast_contrasts_5x5(image, x, y, contrasts, simd);
  int columns[5][3];  // smoothed along x
  for (int row = 0; row < 5; ++row)
    for (int i = 0; i < 3; ++i) {
      const uint8_t* c = contrasts + 5 * row + i;
      columns[row][i] = c[0] + 2 * c[1] + c[2];
    }
  float s[3][3];
  for (int row = 0; row < 3; ++row)
    for (int i = 0; i < 3; ++i)
      s[row][i] = static_cast<float>(columns[row][i] + 2 * columns[row + 1][i] + columns[row + 2][i]);

  // Least-squares quadratic over 3 x 3 samples: gradient and second derivatives at the middle.
  const float left = s[0][0] + s[1][0] + s[2][0], right = s[0][2] + s[1][2] + s[2][2];
  const float top = s[0][0] + s[0][1] + s[0][2], bottom = s[2][0] + s[2][1] + s[2][2];
  const float gx = (right - left) / 6.0F, gy = (bottom - top) / 6.0F;
  const float xx = (left + right - 2.0F * (s[0][1] + s[1][1] + s[2][1])) / 3.0F;
  const float yy = (top + bottom - 2.0F * (s[1][0] + s[1][1] + s[1][2])) / 3.0F;
  const float xy = (s[2][2] - s[2][0] - s[0][2] + s[0][0]) / 4.0F;
  const float determinant = xx * yy - xy * xy;
  if (xx >= 0.0F || yy >= 0.0F || determinant <= 0.0F) return {};
  return {std::clamp((xy * gy - yy * gx) / determinant, -1.0F, 1.0F),
          std::clamp((xy * gx - xx * gy) / determinant, -1.0F, 1.0F)};
}

}  // namespace dkb
