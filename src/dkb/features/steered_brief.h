// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/features/simd.h"

namespace dkb {

inline constexpr int kBriefRadius = 15;  // [px] tests stay within this distance of the corner

// One comparison of two smoothed pixels, relative to the corner, in the frame of its orientation [px].
struct BriefTest {
  float ax = 0, ay = 0, bx = 0, by = 0;
};

// The 256 comparisons, computed from a fixed seed: isotropic Gaussian positions (BRIEF, Calonder et al., ECCV 2010),
// chosen greedily for low correlation between tests and for means that do not depend on the orientation itself (the
// aims of Rublee et al., ICCV 2011, section 4.3), judged by a model of image statistics instead of a training set.
std::array<BriefTest, 256> make_brief_tests();

// Computes 256-bit descriptors: bit i is set when the first pixel of test i is darker than the second.
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
