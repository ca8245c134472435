// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/lucas_kanade.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

namespace dkb {
namespace {

constexpr int kWeightBits = 14;
constexpr int kLkShift = kWeightBits - 4;  // leaves 1/16 grey levels
constexpr int kLkRound = 1 << (kLkShift - 1);

// Top-left pixel of a window and the bilinear weights that all its samples share.
struct Placement {
  int x = 0, y = 0;
  int w00 = 0, w01 = 0, w10 = 0, w11 = 0;
};

Placement place(double x, double y, int size) {
  const int floor_x = static_cast<int>(x), floor_y = static_cast<int>(y);  // the window fits, so both are positive
  const double fx = x - floor_x, fy = y - floor_y;
  constexpr double kOne = 1 << kWeightBits;
  Placement p;
  p.x = floor_x - size / 2;
  p.y = floor_y - size / 2;
  p.w00 = static_cast<int>((1 - fx) * (1 - fy) * kOne + 0.5);
  p.w01 = static_cast<int>(fx * (1 - fy) * kOne + 0.5);
  p.w10 = static_cast<int>((1 - fx) * fy * kOne + 0.5);
  p.w11 = (1 << kWeightBits) - p.w00 - p.w01 - p.w10;
  return p;
}

void sample_scalar(const GreyImage& image, const Placement& p, int size, int16_t* samples) {
  for (int row = 0; row < size; ++row) {
    const uint8_t* upper = image.row(p.y + row) + p.x;
    const uint8_t* lower = image.row(std::min(p.y + row + 1, image.height() - 1)) + p.x;
    // On the last pixel the weight of the next one is 0; do not read it.
    const int last = image.width() - 1 - p.x;
    for (int i = 0; i < size; ++i) {
      const int next = std::min(i + 1, last);
      const int sum = upper[i] * p.w00 + upper[next] * p.w01 + lower[i] * p.w10 + lower[next] * p.w11;
      samples[row * kLkStride + i] = static_cast<int16_t>((sum + kLkRound) >> kLkShift);
    }
  }
}

LkSums sums_scalar(const LkTemplate& reference, const int16_t* samples) {
  LkSums sums;
  for (int row = 0; row < kFlowWindow; ++row)
    for (int i = row * kLkStride; i < row * kLkStride + kFlowWindow; ++i) {
      const int d = samples[i] - reference.value[i];
      sums.absolute += std::abs(d);
      sums.dx += d * reference.dx[i];
      sums.dy += d * reference.dy[i];
    }
  return sums;
}

#if defined(__x86_64__)
struct PixelPairs {
  __m256i low, high;  // horizontally adjacent pixels of 16 columns, as 16-bit numbers
};

DKB_TARGET_AVX2 inline PixelPairs load_pairs(const uint8_t* p) {
  const __m128i here = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p));
  const __m128i next = _mm_loadu_si128(reinterpret_cast<const __m128i*>(p + 1));
  return {_mm256_cvtepu8_epi16(_mm_unpacklo_epi8(here, next)), _mm256_cvtepu8_epi16(_mm_unpackhi_epi8(here, next))};
}

DKB_TARGET_AVX2 void sample_avx2(const GreyImage& image, const Placement& p, int size, int16_t* samples) {
  const __m256i upper_weights = _mm256_set1_epi32(p.w00 | p.w01 << 16);
  const __m256i lower_weights = _mm256_set1_epi32(p.w10 | p.w11 << 16);
  const __m256i round = _mm256_set1_epi32(kLkRound);
  PixelPairs upper = load_pairs(image.row(p.y) + p.x);
  for (int row = 0; row < size; ++row) {
    const PixelPairs lower = load_pairs(image.row(p.y + row + 1) + p.x);
    __m256i low =
        _mm256_add_epi32(_mm256_madd_epi16(upper.low, upper_weights), _mm256_madd_epi16(lower.low, lower_weights));
    __m256i high =
        _mm256_add_epi32(_mm256_madd_epi16(upper.high, upper_weights), _mm256_madd_epi16(lower.high, lower_weights));
    low = _mm256_srai_epi32(_mm256_add_epi32(low, round), kLkShift);
    high = _mm256_srai_epi32(_mm256_add_epi32(high, round), kLkShift);
    const __m256i packed = _mm256_permute4x64_epi64(_mm256_packs_epi32(low, high), 0xD8);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(samples + row * kLkStride), packed);
    upper = lower;
  }
}

DKB_TARGET_AVX2 LkSums sums_avx2(const LkTemplate& reference, const int16_t* samples) {
  const __m256i ones = _mm256_set1_epi16(1);
  const __m256i index = _mm256_setr_epi16(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  const __m256i inside = _mm256_cmpgt_epi16(_mm256_set1_epi16(kFlowWindow), index);
  __m256i absolute = _mm256_setzero_si256(), dx = absolute, dy = absolute;
  for (int row = 0; row < kFlowWindow; ++row) {
    const int at = row * kLkStride;
    const __m256i difference = _mm256_sub_epi16(load_avx2(samples + at), load_avx2(reference.value + at));
    const __m256i d = _mm256_and_si256(difference, inside);
    absolute = _mm256_add_epi32(absolute, _mm256_madd_epi16(_mm256_abs_epi16(d), ones));
    dx = _mm256_add_epi32(dx, _mm256_madd_epi16(d, load_avx2(reference.dx + at)));
    dy = _mm256_add_epi32(dy, _mm256_madd_epi16(d, load_avx2(reference.dy + at)));
  }
  return {sum_avx2(absolute), sum_avx2(dx), sum_avx2(dy)};
}
#endif

// No sum overflows its 32 bits.
constexpr int64_t kLargest = 255 * kLkOne;  // of samples, differences and slopes
static_assert(kFlowWindow * kFlowWindow * kLargest * kLargest <= std::numeric_limits<int32_t>::max());

}  // namespace

bool lk_fits(const GreyImage& image, double x, double y, int size) {
  const int reach = size / 2;
  return x - reach >= 0 && y - reach >= 0 && x + reach <= image.width() - 1 && y + reach <= image.height() - 1;
}

void lk_sample(const GreyImage& image, double x, double y, int size, int16_t* samples, [[maybe_unused]] Simd simd) {
  const Placement p = place(x, y, size);
#if defined(__x86_64__)
  // 16 columns and their right neighbours are read, one row beyond the window; that must stay in memory.
  const size_t last =
      static_cast<size_t>(p.y + size) * static_cast<size_t>(image.width()) + static_cast<size_t>(p.x + 16);
  if (simd >= Simd::avx2 && last < image.size()) return sample_avx2(image, p, size, samples);
#endif
  sample_scalar(image, p, size, samples);
}

void lk_make_template(const int16_t* samples_with_rim, LkTemplate& target) {
  int32_t xx = 0, xy = 0, yy = 0;
  for (int row = 0; row < kFlowWindow; ++row) {
    const int16_t* middle = samples_with_rim + (row + 1) * kLkStride + 1;
    const int16_t* above = middle - kLkStride;
    const int16_t* below = middle + kLkStride;
    int16_t* value = target.value + row * kLkStride;
    int16_t* dx = target.dx + row * kLkStride;
    int16_t* dy = target.dy + row * kLkStride;
    for (int i = 0; i < kFlowWindow; ++i) {
      value[i] = middle[i];
      dx[i] = static_cast<int16_t>(middle[i + 1] - middle[i - 1]);
      dy[i] = static_cast<int16_t>(below[i] - above[i]);
      xx += dx[i] * dx[i];
      xy += dx[i] * dy[i];
      yy += dy[i] * dy[i];
    }
  }
  target.sum_xx = xx;
  target.sum_xy = xy;
  target.sum_yy = yy;
}

LkSums lk_sums(const LkTemplate& reference, const int16_t* samples, [[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  if (simd >= Simd::avx2) return sums_avx2(reference, samples);
#endif
  return sums_scalar(reference, samples);
}

}  // namespace dkb
