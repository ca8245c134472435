// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/features/simd.h"

namespace dkb {

struct MatchOptions {
  int max_distance = 64;  // [bits] largest Hamming distance of a match, 0 ... 256
  float ratio = 0.8f;     // best distance over second best must be below this, 0 ... 1
  bool mutual = true;     // the match must be the best in both directions
  void check() const;     // throws InvalidOption
};

struct DescriptorMatch {
  int a = 0, b = 0;
  int distance = 0;  // [bits]
  bool operator==(const DescriptorMatch&) const = default;
};

// All descriptors of `a` against all of `b`. Ties go to the smaller index. By increasing a. Throws InvalidOption.
std::vector<DescriptorMatch> match_brute_force(std::span<const Descriptor> a, std::span<const Descriptor> b,
                                               const MatchOptions& options = {}, Simd simd = best_simd());

}  // namespace dkb
