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

inline int hamming_distance(const Descriptor& a, const Descriptor& b) {
  return std::popcount(a[0] ^ b[0]) + std::popcount(a[1] ^ b[1]) + std::popcount(a[2] ^ b[2]) +
         std::popcount(a[3] ^ b[3]);
}

// A corner as the extractor finds it, in pixels of the full-resolution image (as read, distorted).
struct Corner {
  float x = 0, y = 0;  // [px] sub-pixel position
  float angle = 0;     // [rad] orientation in [0, 2 pi)
  float response = 0;  // corner strength, larger is better
  uint8_t octave = 0;  // pyramid level it was found on; its noise grows with the level's scale
};

struct OrbFeatures {
  std::vector<Corner> corners;
  std::vector<Descriptor> descriptors;  // same length
};

}  // namespace dkb
