// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/matching.h"

#include "dkb/util/errors.h"

namespace dkb {

void MatchOptions::check() const {
  require_option(max_distance >= 0 && max_distance <= 256, "max_distance", max_distance, "0 ... 256 bits");
  require_option(ratio >= 0 && ratio <= 1, "ratio", ratio, "0 ... 1");
}

std::vector<DescriptorMatch> match_brute_force(std::span<const Descriptor> a, std::span<const Descriptor> b,
                                               const MatchOptions& options) {
  struct Best {
    int index = -1, distance = 257, second = 257;
  };
  std::vector<Best> of_a(a.size()), of_b(b.size());
  for (size_t i = 0; i < a.size(); ++i)
    for (size_t j = 0; j < b.size(); ++j) {
      const int d = hamming_distance(a[i], b[j]);
      const auto offer = [d](Best& best, size_t index) {
        if (d < best.distance) {
          best.second = best.distance;
          best.distance = d;
          best.index = static_cast<int>(index);
        } else if (d < best.second) {
          best.second = d;
        }
      };
      offer(of_a[i], j);
      offer(of_b[j], i);
    }
  std::vector<DescriptorMatch> matches;
  for (size_t i = 0; i < a.size(); ++i) {
    const Best& best = of_a[i];
    if (best.index < 0 || best.distance > options.max_distance) continue;
    if (static_cast<float>(best.distance) >= options.ratio * static_cast<float>(best.second)) continue;
    if (options.mutual && of_b[static_cast<size_t>(best.index)].index != static_cast<int>(i)) continue;
    matches.push_back({static_cast<int>(i), best.index, best.distance});
  }
  return matches;
}

}  // namespace dkb
