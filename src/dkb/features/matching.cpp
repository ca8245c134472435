// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/matching.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr size_t kBlock = 64;  // distances computed before they are looked at

// Distances of `query` to `count` descriptors: set[candidates[i]], or set[i] without candidates.
void distances_scalar(const Descriptor& query, const Descriptor* set, const int32_t* candidates, size_t count,
                      int32_t* distances) {
  for (size_t i = 0; i < count; ++i)
    distances[i] = hamming_distance(query, set[candidates != nullptr ? static_cast<size_t>(candidates[i]) : i]);
}

#if defined(__x86_64__)
DKB_TARGET_AVX2 void distances_popcnt(const Descriptor& query, const Descriptor* set, const int32_t* candidates,
                                      size_t count, int32_t* distances) {
  const uint64_t q0 = query[0], q1 = query[1], q2 = query[2], q3 = query[3];
  for (size_t i = 0; i < count; ++i) {
    const Descriptor& other = set[candidates != nullptr ? static_cast<size_t>(candidates[i]) : i];
    distances[i] = static_cast<int32_t>(__builtin_popcountll(q0 ^ other[0]) + __builtin_popcountll(q1 ^ other[1]) +
                                        __builtin_popcountll(q2 ^ other[2]) + __builtin_popcountll(q3 ^ other[3]));
  }
}
#endif

void distances_of(const Descriptor& query, const Descriptor* set, const int32_t* candidates, size_t count,
                  int32_t* distances, [[maybe_unused]] Simd simd) {
#if defined(__x86_64__)
  if (simd >= Simd::avx2) return distances_popcnt(query, set, candidates, count, distances);
#endif
  distances_scalar(query, set, candidates, count, distances);
}

void offer(BestTwo& best, int index, int distance) {
  if (distance < best.distance) {
    best = {index, distance, best.distance};
  } else if (distance < best.second) {
    best.second = distance;
  }
}

}  // namespace

void MatchOptions::check() const {
  require_option(max_distance >= 0 && max_distance <= 256, "max_distance", max_distance, "0 ... 256 bits");
  require_option(ratio >= 0 && ratio <= 1, "ratio", ratio, "0 ... 1");
}

void hamming_distances(const Descriptor& query, std::span<const Descriptor> set, std::span<const int32_t> candidates,
                       std::span<int32_t> distances, Simd simd) {
  distances_of(query, set.data(), candidates.data(), std::min(candidates.size(), distances.size()), distances.data(),
               simd);
}

BestTwo best_two(const Descriptor& query, std::span<const Descriptor> set, std::span<const int32_t> candidates,
                 Simd simd) {
  std::array<int32_t, kBlock> distances;
  BestTwo best;
  for (size_t first = 0; first < candidates.size(); first += kBlock) {
    const size_t count = std::min(kBlock, candidates.size() - first);
    distances_of(query, set.data(), candidates.data() + first, count, distances.data(), simd);
    for (size_t i = 0; i < count; ++i) offer(best, candidates[first + i], distances[i]);
  }
  return best;
}

BestTwo best_two(const Descriptor& query, std::span<const Descriptor> set, Simd simd) {
  std::array<int32_t, kBlock> distances;
  BestTwo best;
  for (size_t first = 0; first < set.size(); first += kBlock) {
    const size_t count = std::min(kBlock, set.size() - first);
    distances_of(query, set.data() + first, nullptr, count, distances.data(), simd);
    for (size_t i = 0; i < count; ++i) offer(best, static_cast<int>(first + i), distances[i]);
  }
  return best;
}

std::vector<DescriptorMatch> match_brute_force(std::span<const Descriptor> a, std::span<const Descriptor> b,
                                               const MatchOptions& options, Simd simd) {
  options.check();
  std::vector<DescriptorMatch> best_of_b(b.size(), {.a = -1, .b = -1, .distance = 257});  // the nearest of a to each b
  std::vector<DescriptorMatch> matches;
  std::array<int32_t, kBlock> distances;
  for (size_t i = 0; i < a.size(); ++i) {
    BestTwo best;
    for (size_t first = 0; first < b.size(); first += kBlock) {
      const size_t count = std::min(kBlock, b.size() - first);
      distances_of(a[i], b.data() + first, nullptr, count, distances.data(), simd);
      for (size_t j = 0; j < count; ++j) {
        offer(best, static_cast<int>(first + j), distances[j]);
        DescriptorMatch& of_b = best_of_b[first + j];
        if (distances[j] < of_b.distance) of_b = {static_cast<int>(i), static_cast<int>(first + j), distances[j]};
      }
    }
    if (best.index < 0 || best.distance > options.max_distance) continue;
    if (static_cast<float>(best.distance) >= options.ratio * static_cast<float>(best.second)) continue;
    matches.push_back({static_cast<int>(i), best.index, best.distance});
  }
  if (options.mutual)
    std::erase_if(matches, [&](const DescriptorMatch& m) { return best_of_b[static_cast<size_t>(m.b)].a != m.a; });
  return matches;
}

std::vector<bool> consistent_orientations(std::span<const float> angles_a, std::span<const float> angles_b) {
  constexpr size_t kBins = 30;
  constexpr double kTurn = 2 * std::numbers::pi;
  const size_t count = std::min(angles_a.size(), angles_b.size());
  std::vector<bool> keep(count, true);
  if (count < 3) return keep;
  const auto bin_of = [&](size_t i) {
    const double rotation = static_cast<double>(angles_a[i]) - static_cast<double>(angles_b[i]);
    const double share = rotation / kTurn - std::floor(rotation / kTurn);  // [0, 1), or 1 by rounding
    return static_cast<size_t>(share * kBins) % kBins;
  };
  std::array<int, kBins> counts{};
  for (size_t i = 0; i < count; ++i) ++counts[bin_of(i)];
  // A peak may lie on the border of two bins, so each is judged together with its neighbours.
  std::array<int, kBins> smoothed{};
  for (size_t k = 0; k < kBins; ++k)
    smoothed[k] = counts[(k + kBins - 1) % kBins] + 2 * counts[k] + counts[(k + 1) % kBins];
  const size_t peak = static_cast<size_t>(std::max_element(smoothed.begin(), smoothed.end()) - smoothed.begin());
  for (size_t i = 0; i < count; ++i) {
    const size_t away = (bin_of(i) + kBins - peak) % kBins;
    keep[i] = away <= 1 || away == kBins - 1;
  }
  return keep;
}

}  // namespace dkb
