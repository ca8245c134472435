// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "dkb/features/simd.h"
#include "dkb/image/image.h"

namespace dkb {

// Kernels of Lucas-Kanade alignment, of optical flow. Intensities are in 1/16 grey levels and all sums are integers, so
// that every implementation gives the same bits.
//
// A window of `size` x `size` samples at (x, y) covers x - size / 2 + i, i = 0 ... size - 1 (integer division), so that
// for odd sizes (x, y) is its middle.
inline constexpr int kLkMaxSize = 29;  // [samples] so that the window with its rim fits a row of 32
inline constexpr int kLkStride = 32;   // samples from row to row in the buffers
inline constexpr int kLkOne = 16;      // one grey level

using LkSamples = int16_t[(kLkMaxSize + 2) * kLkStride];

// What is aligned: samples and their slopes (difference of the two neighbours, 1/16 grey level per 2 px).
struct LkTemplate {
  int size = 0;
  alignas(32) LkSamples value, dx, dy;
  int64_t sum_xx = 0, sum_xy = 0, sum_yy = 0;  // of products of slopes
};

// Sums over the window of d = image - template.
struct LkSums {
  int64_t absolute = 0;
  int64_t dx = 0, dy = 0;  // times slope
  bool operator==(const LkSums&) const = default;
};

// Whether the window lies within the image.
bool lk_fits(const GreyImage& image, double x, double y, int size);
// Bilinear samples of the window, which must fit. `size` up to kLkMaxSize + 2. Columns from `size` on are undefined.
void lk_sample(const GreyImage& image, double x, double y, int size, int16_t* samples, Simd simd);
// Fills the template from samples of the window with a rim of one sample (size + 2 squared).
void lk_make_template(const int16_t* samples_with_rim, int size, LkTemplate& target);
// `samples` of a window of the template's size.
LkSums lk_sums(const LkTemplate& reference, const int16_t* samples, Simd simd);

}  // namespace dkb
