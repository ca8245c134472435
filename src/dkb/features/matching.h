// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dkb/features/features.h"
#include "dkb/features/simd.h"

namespace dkb {

struct DescriptorMatch {
  int a = 0, b = 0;
  int distance = 0;  // [bits]
  bool operator==(const DescriptorMatch&) const = default;
};

// All descriptors of `a` against all of `b`: matches are the best in both directions, differ in 64 bits at most, and in
// less than 0.8 of those of the second best of `b`. Ties go to the smaller index. By increasing a.
std::vector<DescriptorMatch> match_brute_force(std::span<const Descriptor> a, std::span<const Descriptor> b,
                                               Simd simd = best_simd());

}  // namespace dkb
