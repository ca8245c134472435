// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/features/simd.h"

namespace dkb {

inline constexpr int kBriefRadius = 15;  // [px] tests stay within this distance of the corner

// Computes 256-bit descriptors: bit i is set when the first pixel of test i (kBriefTests) is darker than the second.
// The pattern is steered in kRotations steps with positions rounded to pixels.
class SteeredBrief {
 public:
  static constexpr int kRotations = 64;

  explicit SteeredBrief(Simd simd = best_simd());

  // `centre` points at the corner's pixel in a smoothed image with rows `stride` bytes apart; kBriefRadius + 3 pixels
  // to each side must exist. `angle` [rad] in [0, 2 pi).
  Descriptor describe(const uint8_t* centre, ptrdiff_t stride, float angle) const;

 private:
  struct Offset {
    int16_t x = 0, y = 0;
  };
  Simd simd_;
  std::vector<Offset> offsets_;  // per rotation: the 256 first pixels, then the 256 second ones
};

}  // namespace dkb
