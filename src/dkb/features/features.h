// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#if defined(__x86_64__)
#include <emmintrin.h>
#endif

namespace dkb {

// 256-bit binary descriptor.
using Descriptor = std::array<uint64_t, 4>;

// Number of bits that differ, 0 ... 256.
inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
#if defined(__x86_64__)
  // The baseline processor has no population count: bits are added up in parallel in fields of 2, 4 and 8 bits.
  const auto differing = [&](size_t word) {
    return _mm_xor_si128(_mm_loadu_si128(reinterpret_cast<const __m128i*>(a.data() + word)),
                         _mm_loadu_si128(reinterpret_cast<const __m128i*>(b.data() + word)));
  };
  const __m128i m1 = _mm_set1_epi8(0x55), m2 = _mm_set1_epi8(0x33), m4 = _mm_set1_epi8(0x0F);
  __m128i x = differing(0), y = differing(2);
  x = _mm_sub_epi8(x, _mm_and_si128(_mm_srli_epi64(x, 1), m1));
  y = _mm_sub_epi8(y, _mm_and_si128(_mm_srli_epi64(y, 1), m1));
  x = _mm_add_epi8(_mm_and_si128(x, m2), _mm_and_si128(_mm_srli_epi64(x, 2), m2));
  y = _mm_add_epi8(_mm_and_si128(y, m2), _mm_and_si128(_mm_srli_epi64(y, 2), m2));
  x = _mm_add_epi8(x, y);
  x = _mm_add_epi8(_mm_and_si128(x, m4), _mm_and_si128(_mm_srli_epi64(x, 4), m4));
  x = _mm_sad_epu8(x, _mm_setzero_si128());
  return _mm_cvtsi128_si32(_mm_add_epi64(x, _mm_unpackhi_epi64(x, x)));
#else
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
#endif
}

// A corner as the extractor finds it, in pixels of the full-resolution image (as read, distorted).
struct Corner {
  float x = 0, y = 0;     // [px] sub-pixel position
  float angle = 0;        // [rad] orientation in [0, 2 pi)
  float response = 0;     // corner strength, larger is better
  uint8_t octave = 0;     // pyramid level it was found on; its noise grows with the level's scale
  float place_sigma = 0;  // [px] standard deviation along the direction in which the image tells its place least
};

struct OrbFeatures {
  std::vector<Corner> corners;
  std::vector<Descriptor> descriptors;  // same length
};

}  // namespace dkb
