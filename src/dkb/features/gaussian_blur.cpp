// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/gaussian_blur.h"

#include <algorithm>

namespace dkb {
namespace {

// exp(-i^2 / 8), i = 0 ... 3, scaled so that all seven add up to 256.
constexpr int kWeights[4] = {54, 49, 34, 18};
static_assert(kWeights[0] + 2 * (kWeights[1] + kWeights[2] + kWeights[3]) == 256);

// Seven samples `step` bytes apart about p.
inline uint8_t weighted(const uint8_t* p, ptrdiff_t step) {
  int sum = kWeights[0] * p[0] + 128;
  for (int i = 1; i <= kBlurRadius; ++i) sum += kWeights[i] * (p[-i * step] + p[i * step]);
  return static_cast<uint8_t>(sum >> 8);
}

#if defined(__x86_64__)
// 32 outputs from seven samples `step` bytes apart. Sums reach 65408, so they wrap as signed 16-bit numbers and are
// read as unsigned ones; no product of a pair exceeds 26265, so none saturates.
DKB_TARGET_AVX2 inline __m256i weighted_avx2(const uint8_t* p, ptrdiff_t step) {
  const __m256i outer = _mm256_set1_epi16(static_cast<int16_t>(kWeights[3] | (kWeights[3] << 8)));
  const __m256i middle = _mm256_set1_epi16(static_cast<int16_t>(kWeights[2] | (kWeights[2] << 8)));
  const __m256i inner = _mm256_set1_epi16(static_cast<int16_t>(kWeights[1] | (kWeights[1] << 8)));
  const __m256i centre = _mm256_set1_epi16(static_cast<int16_t>(kWeights[0]));
  const __m256i a = load_avx2(p - 3 * step), b = load_avx2(p + 3 * step), c = load_avx2(p - 2 * step),
                d = load_avx2(p + 2 * step);
  const __m256i e = load_avx2(p - step), f = load_avx2(p + step), g = load_avx2(p);
  const __m256i zero = _mm256_setzero_si256(), half = _mm256_set1_epi16(128);
  __m256i low = _mm256_add_epi16(_mm256_maddubs_epi16(_mm256_unpacklo_epi8(a, b), outer),
                                 _mm256_maddubs_epi16(_mm256_unpacklo_epi8(c, d), middle));
  low = _mm256_add_epi16(low, _mm256_add_epi16(_mm256_maddubs_epi16(_mm256_unpacklo_epi8(e, f), inner),
                                               _mm256_maddubs_epi16(_mm256_unpacklo_epi8(g, zero), centre)));
  __m256i high = _mm256_add_epi16(_mm256_maddubs_epi16(_mm256_unpackhi_epi8(a, b), outer),
                                  _mm256_maddubs_epi16(_mm256_unpackhi_epi8(c, d), middle));
  high = _mm256_add_epi16(high, _mm256_add_epi16(_mm256_maddubs_epi16(_mm256_unpackhi_epi8(e, f), inner),
                                                 _mm256_maddubs_epi16(_mm256_unpackhi_epi8(g, zero), centre)));
  low = _mm256_srli_epi16(_mm256_add_epi16(low, half), 8);
  high = _mm256_srli_epi16(_mm256_add_epi16(high, half), 8);
  return _mm256_packus_epi16(low, high);
}

// out[begin ... end) from in[begin ... end); at least 32 outputs, the last block overlaps the one before it.
DKB_TARGET_AVX2 void filter_avx2(const uint8_t* in, ptrdiff_t step, int begin, int end, uint8_t* out) {
  for (int x = begin; x < end; x += 32) {
    const int at = std::min(x, end - 32);
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out + at), weighted_avx2(in + at, step));
  }
}
#endif

}  // namespace

void GaussianBlur::apply(const GreyImage& image, GreyImage& blurred) {
  const int width = image.width(), height = image.height(), r = kBlurRadius;
  if (blurred.width() != width || blurred.height() != height) blurred = GreyImage(width, height);
  row_.resize(static_cast<size_t>(width));
  for (int y = 0; y < height; ++y) {
    uint8_t* out = blurred.row(y);
    const uint8_t* in = image.row(y);
    if (y < r || y >= height - r || width <= 2 * r) {
      std::copy(in, in + width, out);
      continue;
    }
    std::copy(in, in + r, out);
    std::copy(in + width - r, in + width, out + width - r);
#if defined(__x86_64__)
    if (simd_ >= Simd::avx2 && width >= 32 + 2 * r) {
      filter_avx2(in, width, 0, width, row_.data());
      filter_avx2(row_.data(), 1, r, width - r, out);
      continue;
    }
#endif
    for (int x = 0; x < width; ++x) row_[static_cast<size_t>(x)] = weighted(in + x, width);
    for (int x = r; x < width - r; ++x) out[x] = weighted(row_.data() + x, 1);
  }
}

}  // namespace dkb
