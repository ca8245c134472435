// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/subpixel.h"

#include <algorithm>
#include <cmath>

#include "dkb/features/fast_corners.h"

namespace dkb {

namespace {

// [grey levels] of a contrast: the difference of two pixels, each taken to be off by 2.4 levels, as the simulator's
// are.
constexpr float kContrastSigma = 3.4F;
// Of the gradient below: the root of the sum of its kernel's squares, (1 2 0 -2 -1) by (1 3 4 3 1) over 6, is the root
// of 10.
constexpr float kGradientSigma = 3.16F * kContrastSigma;
constexpr float kNowhere = 4;  // [px] where there is no peak the corner is anywhere that matching looks for it

}  // namespace

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
  if (xx >= 0.0F || yy >= 0.0F || determinant <= 0.0F) return {0, 0, kNowhere};
  const float half_difference = 0.5F * (xx - yy);
  const float least_curvature = -0.5F * (xx + yy) - std::sqrt(half_difference * half_difference + xy * xy);
  const float sigma = kGradientSigma < kNowhere * least_curvature ? kGradientSigma / least_curvature : kNowhere;
  return {std::clamp((xy * gy - yy * gx) / determinant, -1.0F, 1.0F),
          std::clamp((xy * gx - xx * gy) / determinant, -1.0F, 1.0F), sigma};
}

}  // namespace dkb
