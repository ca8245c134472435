// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/fast_corners.h"

#include <algorithm>
#include <array>
#include <bit>

namespace dkb {
namespace {

constexpr int kRowPadding = 64;  // bytes on both sides of a score row: emit_avx2() looks at 64 pixels at once
constexpr int kSpare = 4;        // corners written at once

// Offsets of the 16 pixels of the circle in order, for rows `stride` bytes apart.
std::array<ptrdiff_t, 16> circle_offsets(ptrdiff_t stride) {
  constexpr int kX[16] = {0, 1, 2, 3, 3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1};
  constexpr int kY[16] = {3, 3, 2, 1, 0, -1, -2, -3, -3, -3, -2, -1, 0, 1, 2, 3};
  std::array<ptrdiff_t, 16> offsets{};
  for (size_t i = 0; i < 16; ++i) offsets[i] = kY[i] * stride + kX[i];
  return offsets;
}

// Largest over arcs of 9 of the smallest contrast in the arc; 0 unless it exceeds the threshold.
// Arcs 2k and 2k + 1 share eight pixels, whose extremes come from pairs and fours of neighbours.
uint8_t contrast_scalar(const uint8_t* centre, const std::array<ptrdiff_t, 16>& circle, int threshold) {
  int p[17];
  for (size_t i = 0; i < 16; ++i) p[i] = centre[circle[i]];
  p[16] = p[0];
  int low2[8], high2[8], low4[8], high4[8];
  for (int k = 0; k < 8; ++k) {
    low2[k] = std::min(p[2 * k + 1], p[2 * k + 2]);
    high2[k] = std::max(p[2 * k + 1], p[2 * k + 2]);
  }
  for (int k = 0; k < 8; ++k) {
    low4[k] = std::min(low2[k], low2[(k + 1) & 7]);
    high4[k] = std::max(high2[k], high2[(k + 1) & 7]);
  }
  int bright = 0, dark = 255;
  for (int k = 0; k < 8; ++k) {
    const int first = p[2 * k], last = p[(2 * k + 9) & 15];
    bright = std::max(bright, std::min({low4[k], low4[(k + 2) & 7], std::max(first, last)}));
    dark = std::min(dark, std::max({high4[k], high4[(k + 2) & 7], std::min(first, last)}));
  }
  const int contrast = std::max(bright - centre[0], centre[0] - dark);
  return contrast > threshold ? static_cast<uint8_t>(contrast) : uint8_t{0};
}

void score_row_scalar(const uint8_t* row, int begin, int end, const std::array<ptrdiff_t, 16>& circle, int threshold,
                      uint8_t* scores) {
  for (int x = begin; x < end; ++x) scores[x] = contrast_scalar(row + x, circle, threshold);
}

void emit_scalar(const uint8_t* above, const uint8_t* here, const uint8_t* below, int begin, int end, int y,
                 std::vector<PixelCorner>& corners) {
  for (int x = begin; x < end; ++x) {
    const uint8_t s = here[x];
    if (s == 0) continue;
    if (s > here[x - 1] && s > here[x + 1] && s > above[x - 1] && s > above[x] && s > above[x + 1] &&
        s > below[x - 1] && s > below[x] && s > below[x + 1])
      corners.push_back({static_cast<uint16_t>(x), static_cast<uint16_t>(y), static_cast<uint8_t>(s - 1)});
  }
}

#if defined(__x86_64__)
// Scores of 32 pixels; pixels at or below the threshold score 0. With kEarlyOut blocks without any corner cost less.
template <bool kEarlyOut>
DKB_TARGET_AVX2 __attribute__((always_inline)) inline __m256i contrast_avx2(const uint8_t* centre,
                                                                            const std::array<ptrdiff_t, 16>& circle,
                                                                            __m256i threshold) {
  const __m256i zero = _mm256_setzero_si256();
  const __m256i c = load_avx2(centre);
  // An arc of 9 holds two neighbours of any four pixels at right angles: the larger of one diameter and the larger of
  // the other must both be brighter (or the smaller ones darker).
  __m256i may = _mm256_set1_epi8(-1);
  __m256i bright_bound = may, dark_bound = zero;
  for (size_t i = 0; kEarlyOut && i < 4; i += 2) {
    const __m256i a = load_avx2(centre + circle[i]), b = load_avx2(centre + circle[i + 8]);
    const __m256i d = load_avx2(centre + circle[i + 4]), e = load_avx2(centre + circle[i + 12]);
    bright_bound = _mm256_min_epu8(bright_bound, _mm256_min_epu8(_mm256_max_epu8(a, b), _mm256_max_epu8(d, e)));
    dark_bound = _mm256_max_epu8(dark_bound, _mm256_max_epu8(_mm256_min_epu8(a, b), _mm256_min_epu8(d, e)));
    const __m256i contrast = _mm256_max_epu8(_mm256_subs_epu8(bright_bound, c), _mm256_subs_epu8(c, dark_bound));
    may = _mm256_subs_epu8(contrast, threshold);
    if (_mm256_testz_si256(may, may)) return zero;
  }
  __m256i p[16];
  for (size_t i = 0; i < 16; ++i) p[i] = load_avx2(centre + circle[i]);
  __m256i pairs[8], fours[8];
  for (size_t k = 0; k < 8; ++k) pairs[k] = _mm256_min_epu8(p[2 * k + 1], p[(2 * k + 2) & 15]);
  for (size_t k = 0; k < 8; ++k) fours[k] = _mm256_min_epu8(pairs[k], pairs[(k + 1) & 7]);
  __m256i bright = zero;
  for (size_t k = 0; k < 8; ++k) {
    const __m256i eight = _mm256_min_epu8(fours[k], fours[(k + 2) & 7]);
    bright = _mm256_max_epu8(bright, _mm256_min_epu8(eight, _mm256_max_epu8(p[2 * k], p[(2 * k + 9) & 15])));
  }
  for (size_t k = 0; k < 8; ++k) pairs[k] = _mm256_max_epu8(p[2 * k + 1], p[(2 * k + 2) & 15]);
  for (size_t k = 0; k < 8; ++k) fours[k] = _mm256_max_epu8(pairs[k], pairs[(k + 1) & 7]);
  __m256i dark = _mm256_set1_epi8(-1);
  for (size_t k = 0; k < 8; ++k) {
    const __m256i eight = _mm256_max_epu8(fours[k], fours[(k + 2) & 7]);
    dark = _mm256_min_epu8(dark, _mm256_max_epu8(eight, _mm256_min_epu8(p[2 * k], p[(2 * k + 9) & 15])));
  }
  const __m256i contrast = _mm256_max_epu8(_mm256_subs_epu8(bright, c), _mm256_subs_epu8(c, dark));
  const __m256i too_small = _mm256_cmpeq_epi8(_mm256_subs_epu8(contrast, threshold), zero);
  return _mm256_andnot_si256(too_small, contrast);
}

DKB_TARGET_AVX2 void contrasts_5x5_avx2(const uint8_t* centre, ptrdiff_t stride, uint8_t (&contrasts)[25]) {
  const std::array<ptrdiff_t, 16> circle = circle_offsets(stride);
  for (ptrdiff_t row = 0; row < 5; ++row) {
    alignas(32) uint8_t block[32];
    const __m256i values = contrast_avx2<false>(centre + (row - 2) * stride - 2, circle, _mm256_setzero_si256());
    _mm256_store_si256(reinterpret_cast<__m256i*>(block), values);
    std::copy(block, block + 5, contrasts + 5 * row);
  }
}

DKB_TARGET_AVX2 void score_row_avx2(const uint8_t* row, int begin, int end, const std::array<ptrdiff_t, 16>& circle,
                                    int threshold, uint8_t* scores) {
  const __m256i t = _mm256_set1_epi8(static_cast<char>(threshold));
  for (int x = begin; x < end; x += 32) {
    const int at = std::min(x, end - 32);  // the last block overlaps the one before it, with the same result
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(scores + at), contrast_avx2<true>(row + at, circle, t));
  }
}

// Which of 32 pixels score more than all their neighbours, as bits.
DKB_TARGET_AVX2 inline uint64_t peaks_avx2(const uint8_t* above, const uint8_t* here, const uint8_t* below) {
  const __m256i s = load_avx2(here);
  __m256i m = _mm256_max_epu8(load_avx2(here - 1), load_avx2(here + 1));
  m = _mm256_max_epu8(m, _mm256_max_epu8(load_avx2(above - 1), load_avx2(above)));
  m = _mm256_max_epu8(m, _mm256_max_epu8(load_avx2(above + 1), load_avx2(below - 1)));
  m = _mm256_max_epu8(m, _mm256_max_epu8(load_avx2(below), load_avx2(below + 1)));
  const __m256i not_above = _mm256_cmpeq_epi8(_mm256_subs_epu8(s, m), _mm256_setzero_si256());
  return ~static_cast<uint32_t>(_mm256_movemask_epi8(not_above));
}

// Corners of a row to `out`, which has room for kSpare more than there can be; returns the end of them.
DKB_TARGET_AVX2 PixelCorner* emit_avx2(const uint8_t* above, const uint8_t* here, const uint8_t* below, int begin,
                                       int end, int y, PixelCorner* out) {
  for (int x = begin; x < end; x += 64) {
    uint64_t peaks = peaks_avx2(above + x, here + x, below + x);
    if (end - x > 32) peaks |= peaks_avx2(above + x + 32, here + x + 32, below + x + 32) << 32;
    if (end - x < 64) peaks &= (uint64_t{1} << (end - x)) - 1;
    const int count = std::popcount(peaks);
    const auto put = [&](int k) {
      const int at = x + std::countr_zero(peaks | uint64_t{1} << 63);
      out[k] = {static_cast<uint16_t>(at), static_cast<uint16_t>(y), static_cast<uint8_t>(here[at] - 1)};
      peaks &= peaks - 1;
    };
    // Always kSpare, of which those beyond `count` are written over: branches on how many there are would be
    // mispredicted.
    for (int k = 0; k < kSpare; ++k) put(k);
    for (int k = kSpare; k < count; ++k) put(k);
    out += count;
  }
  return out;
}
#endif

}  // namespace

void fast_contrasts_5x5(const GreyImage& image, int x, int y, uint8_t (&contrasts)[25], [[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  // The vector kernel loads 32 pixels from three columns left of the window on, in rows up to five below (x, y).
  const size_t last = static_cast<size_t>(y + 5) * static_cast<size_t>(image.width()) + static_cast<size_t>(x + 1 + 31);
  if (simd >= Simd::avx2 && last < image.size()) return contrasts_5x5_avx2(image.row(y) + x, image.width(), contrasts);
#endif
  const std::array<ptrdiff_t, 16> circle = circle_offsets(image.width());
  for (int row = 0; row < 5; ++row)
    for (int column = 0; column < 5; ++column)
      contrasts[5 * row + column] = contrast_scalar(image.row(y + row - 2) + x + column - 2, circle, 0);
}

void FastCornerFinder::find(const GreyImage& image, int threshold, int border, std::vector<PixelCorner>& corners) {
  corners.clear();
  border = std::max(border, kFastRadius);
  threshold = std::clamp(threshold, 1, 254);
  const int begin = border, end = image.width() - border;
  const int top = border, bottom = image.height() - border;
  if (begin >= end || top >= bottom) return;
  // One pixel more on each side, since suppression compares with the neighbours.
  const int score_begin = std::max(begin - 1, kFastRadius), score_end = std::min(end + 1, image.width() - kFastRadius);
  const std::array<ptrdiff_t, 16> circle = circle_offsets(image.width());
  const bool vectorised = simd_ >= Simd::avx2 && score_end - score_begin >= 32;

  const size_t stride = static_cast<size_t>(image.width() + 2 * kRowPadding);
  scores_.assign(3 * stride, 0);
  row_.resize(static_cast<size_t>(image.width() / 2 + 1 + kSpare));
  const auto score_row = [&](int y) { return scores_.data() + static_cast<size_t>(y % 3) * stride + kRowPadding; };
  const auto fill_row = [&](int y) {
    uint8_t* scores = score_row(y);
    if (y < kFastRadius || y >= image.height() - kFastRadius) {
      std::fill(scores, scores + image.width(), uint8_t{0});
      return;
    }
#if defined(__x86_64__)
    if (vectorised) return score_row_avx2(image.row(y), score_begin, score_end, circle, threshold, scores);
#endif
    score_row_scalar(image.row(y), score_begin, score_end, circle, threshold, scores);
  };

  fill_row(top - 1);
  fill_row(top);
  for (int y = top; y < bottom; ++y) {
    fill_row(y + 1);
#if defined(__x86_64__)
    if (vectorised) {
      const PixelCorner* const found =
          emit_avx2(score_row(y - 1), score_row(y), score_row(y + 1), begin, end, y, row_.data());
      corners.insert(corners.end(), static_cast<const PixelCorner*>(row_.data()), found);
      continue;
    }
#endif
    emit_scalar(score_row(y - 1), score_row(y), score_row(y + 1), begin, end, y, corners);
  }
}

}  // namespace dkb
