// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/matching.h"

#include <algorithm>
#include <array>

namespace dkb {
namespace {

constexpr int kMaxDistance = 64;   // [bits] largest Hamming distance of a match
constexpr float kRatio = 0.8F;     // best distance over second best must be below this
constexpr size_t kDistances = 64;  // distances computed before they are looked at

// The nearest descriptor, and the distance of the next one.
struct BestTwo {
  int index = -1;
  int distance = 257, second = 257;  // [bits]
};

#if defined(__x86_64__)
DKB_TARGET_AVX2 void distances_popcnt(const Descriptor& query, const Descriptor* set, size_t count,
                                      int32_t* distances) {
  const uint64_t q0 = query[0], q1 = query[1], q2 = query[2], q3 = query[3];
  for (size_t i = 0; i < count; ++i) {
    const Descriptor& other = set[i];
    distances[i] = static_cast<int32_t>(__builtin_popcountll(q0 ^ other[0]) + __builtin_popcountll(q1 ^ other[1]) +
                                        __builtin_popcountll(q2 ^ other[2]) + __builtin_popcountll(q3 ^ other[3]));
  }
}
#endif

// Distances of `query` to the `count` descriptors of `set`.
void distances_of(const Descriptor& query, const Descriptor* set, size_t count, int32_t* distances,
                  [[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  if (simd >= Simd::avx2) return distances_popcnt(query, set, count, distances);
#endif
  for (size_t i = 0; i < count; ++i) distances[i] = hamming_distance(query, set[i]);
}

void offer(BestTwo& best, int index, int distance) {
  if (distance < best.distance) {
    best = {index, distance, best.distance};
  } else if (distance < best.second) {
    best.second = distance;
  }
}

}  // namespace

std::vector<DescriptorMatch> match_brute_force(std::span<const Descriptor> a, std::span<const Descriptor> b,
                                               Simd simd) {
  std::vector<DescriptorMatch> best_of_b(b.size(), {.a = -1, .b = -1, .distance = 257});  // the nearest of a to each b
  std::vector<DescriptorMatch> matches;
  std::array<int32_t, kDistances> distances;
  for (size_t i = 0; i < a.size(); ++i) {
    BestTwo best;
    for (size_t first = 0; first < b.size(); first += kDistances) {
      const size_t count = std::min(kDistances, b.size() - first);
      distances_of(a[i], b.data() + first, count, distances.data(), simd);
      for (size_t j = 0; j < count; ++j) {
        offer(best, static_cast<int>(first + j), distances[j]);
        DescriptorMatch& of_b = best_of_b[first + j];
        if (distances[j] < of_b.distance) of_b = {static_cast<int>(i), static_cast<int>(first + j), distances[j]};
      }
    }
    if (best.index < 0 || best.distance > kMaxDistance) continue;
    if (static_cast<float>(best.distance) >= kRatio * static_cast<float>(best.second)) continue;
    matches.push_back({static_cast<int>(i), best.index, best.distance});
  }
  std::erase_if(matches, [&](const DescriptorMatch& m) { return best_of_b[static_cast<size_t>(m.b)].a != m.a; });
  return matches;
}

}  // namespace dkb
