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

// The nearest of some candidates, and the distance of the next one. Without candidates: index -1, distances 257.
struct BestTwo {
  int index = -1;
  int distance = 257, second = 257;  // [bits]
  bool operator==(const BestTwo&) const = default;
};

// Hamming distances of `query` to the descriptors set[candidates[i]]; `distances` as long as `candidates`.
void hamming_distances(const Descriptor& query, std::span<const Descriptor> set, std::span<const int32_t> candidates,
                       std::span<int32_t> distances, Simd simd = best_simd());

// Nearest of set[candidates[i]]; `index` is a member of `candidates`. Ties go to the one that comes first.
BestTwo best_two(const Descriptor& query, std::span<const Descriptor> set, std::span<const int32_t> candidates,
                 Simd simd = best_simd());

// Nearest of all of `set`. Ties go to the smaller index.
BestTwo best_two(const Descriptor& query, std::span<const Descriptor> set, Simd simd = best_simd());

// All descriptors of `a` against all of `b`. Ties go to the smaller index. By increasing a. Throws InvalidOption.
std::vector<DescriptorMatch> match_brute_force(std::span<const Descriptor> a, std::span<const Descriptor> b,
                                               const MatchOptions& options = {}, Simd simd = best_simd());

// Which matches agree on how far the image was turned between a and b: angle differences a - b [rad] are counted in 30
// bins of 12 degrees, and those in the fullest bin (judged with its neighbours) and in the two beside it stay. For
// views that differ by one turn about the optical axis, as between frames and keyframes. Both spans of equal length;
// returns one flag per match. Fewer than 3 matches all stay.
std::vector<bool> consistent_orientations(std::span<const float> angles_a, std::span<const float> angles_b);

}  // namespace dkb
