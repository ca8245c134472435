// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "dkb/features/simd.h"
#include "dkb/image/image.h"

namespace dkb {

// Kernels of Lucas-Kanade alignment, of optical flow. Intensities are in 1/16 grey levels and all sums are integers, so
// that every implementation gives the same bits. A window is a square of samples about (x, y), its middle one.
inline constexpr int kFlowWindow = 11;               // [samples] side of the window (k of DKB section 3.1)
inline constexpr int kFlowRimmed = kFlowWindow + 2;  // the same with a rim of one sample
inline constexpr int kLkStride = 16;                 // samples from row to row in the buffers: one register
inline constexpr int kLkOne = 16;                    // one grey level

using LkSamples = int16_t[kFlowRimmed * kLkStride];

// What is aligned: samples and their slopes (difference of the two neighbours, 1/16 grey level per 2 px).
struct LkTemplate {
  alignas(32) LkSamples value{}, dx{}, dy{};
  int32_t sum_xx = 0, sum_xy = 0, sum_yy = 0;  // of products of slopes
};

// Sums over the window of d = image - template.
struct LkSums {
  int32_t absolute = 0;
  int32_t dx = 0, dy = 0;  // times slope
  bool operator==(const LkSums&) const = default;
};

// Whether the window of `size` x `size` samples, `size` odd, lies within the image.
bool lk_fits(const GreyImage& image, double x, double y, int size);
// Bilinear samples of such a window, which must fit. `size` up to kFlowRimmed. Columns from `size` on are undefined.
void lk_sample(const GreyImage& image, double x, double y, int size, int16_t* samples, Simd simd);
// Fills the template from samples of the window with its rim.
void lk_make_template(const int16_t* samples_with_rim, LkTemplate& target);
// `samples` of a window of kFlowWindow.
LkSums lk_sums(const LkTemplate& reference, const int16_t* samples, Simd simd);

}  // namespace dkb
