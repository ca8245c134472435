// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/orientation.h"

#include <array>
#include <cmath>
#include <numbers>

namespace dkb {
namespace {

constexpr int kRadius = kOrientationRadius;

// Half-width of the disc in the row `v` away from the centre.
constexpr int half_width(int v) {
  int u = 0;
  while ((u + 1) * (u + 1) + v * v <= kRadius * kRadius) ++u;
  return u;
}

constexpr std::array<int, kRadius + 1> make_half_widths() {
  std::array<int, kRadius + 1> widths{};
  for (int v = 0; v <= kRadius; ++v) widths[static_cast<size_t>(v)] = half_width(v);
  return widths;
}
constexpr std::array<int, kRadius + 1> kHalfWidths = make_half_widths();

// Bytes of the 32 columns -16 ... 15: which lie in the disc, and their column numbers as weights.
struct Columns {
  alignas(32) std::array<std::array<uint8_t, 32>, kRadius + 1> inside{};
  alignas(32) std::array<int8_t, 32> weight{};
};
constexpr Columns make_columns() {
  Columns columns{};
  for (int i = 0; i < 32; ++i) {
    const int u = i - 16;
    columns.weight[static_cast<size_t>(i)] = static_cast<int8_t>(u);
    for (int v = 0; v <= kRadius; ++v)
      columns.inside[static_cast<size_t>(v)][static_cast<size_t>(i)] =
          u >= -kHalfWidths[static_cast<size_t>(v)] && u <= kHalfWidths[static_cast<size_t>(v)] ? 0xFF : 0;
  }
  return columns;
}
constexpr Columns kColumns = make_columns();

CentroidMoments moments_scalar(const uint8_t* centre, ptrdiff_t stride) {
  CentroidMoments moments;
  for (int u = -kRadius; u <= kRadius; ++u) moments.x += u * centre[u];
  for (int v = 1; v <= kRadius; ++v) {
    const uint8_t* below = centre + v * stride;
    const uint8_t* above = centre - v * stride;
    const int width = kHalfWidths[static_cast<size_t>(v)];
    int difference = 0;
    for (int u = -width; u <= width; ++u) {
      moments.x += u * (below[u] + above[u]);
      difference += below[u] - above[u];
    }
    moments.y += v * difference;
  }
  return moments;
}

#if defined(__x86_64__)
DKB_TARGET_AVX2 CentroidMoments moments_avx2(const uint8_t* centre, ptrdiff_t stride) {
  const __m256i weight = load_avx2(kColumns.weight.data());
  const __m256i ones = _mm256_set1_epi16(1);
  const __m256i zero = _mm256_setzero_si256();
  const __m256i middle = _mm256_and_si256(load_avx2(centre - 16), load_avx2(kColumns.inside[0].data()));
  __m256i x = _mm256_madd_epi16(_mm256_maddubs_epi16(middle, weight), ones);
  // sum of v d_v = sum over k of (sum of d_v with v >= k): running sums from the outermost row inwards.
  __m256i running = zero, y = zero;
  for (int v = kRadius; v >= 1; --v) {
    const __m256i inside = load_avx2(kColumns.inside[static_cast<size_t>(v)].data());
    const __m256i below = _mm256_and_si256(load_avx2(centre + v * stride - 16), inside);
    const __m256i above = _mm256_and_si256(load_avx2(centre - v * stride - 16), inside);
    const __m256i products = _mm256_add_epi16(_mm256_maddubs_epi16(below, weight), _mm256_maddubs_epi16(above, weight));
    x = _mm256_add_epi32(x, _mm256_madd_epi16(products, ones));
    running = _mm256_add_epi32(running, _mm256_sub_epi32(_mm256_sad_epu8(below, zero), _mm256_sad_epu8(above, zero)));
    y = _mm256_add_epi32(y, running);
  }
  return {sum_avx2(x), sum_avx2(y)};
}
#endif

}  // namespace

CentroidMoments centroid_moments(const uint8_t* centre, ptrdiff_t stride, [[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  if (simd >= Simd::avx2) return moments_avx2(centre, stride);
#endif
  return moments_scalar(centre, stride);
}

float orientation_angle(const CentroidMoments& moments) {
  if (moments.x == 0 && moments.y == 0) return 0.0F;
  constexpr float kTurn = 2.0F * std::numbers::pi_v<float>;
  float angle = std::atan2(static_cast<float>(moments.y), static_cast<float>(moments.x));
  if (angle < 0.0F) angle += kTurn;
  return angle < kTurn ? angle : 0.0F;
}

}  // namespace dkb
