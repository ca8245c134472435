// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/local_map.h"

#include <algorithm>

namespace dkb {

std::vector<Candidate> local_map_candidates(const std::vector<PointId>& points, const Map& map,
                                            const LocalMapOptions& options) {
  const auto ranked = map.observers_of(points);
  std::vector<KeyframeId> keyframes;
  const auto add = [&](KeyframeId id) {
    if (static_cast<int>(keyframes.size()) < options.keyframes &&
        std::find(keyframes.begin(), keyframes.end(), id) == keyframes.end())
      keyframes.push_back(id);
  };
  const size_t voted = std::min(ranked.size(), static_cast<size_t>(options.voted_keyframes));
  for (size_t i = 0; i < voted; ++i) add(ranked[i].keyframe);
  for (size_t i = 0; i < voted; ++i) {
    const auto& neighbours = map.keyframe(ranked[i].keyframe)->covisible;
    for (size_t n = 0; n < std::min(neighbours.size(), static_cast<size_t>(options.neighbours_of_each)); ++n)
      add(neighbours[n].keyframe);
  }
  return candidates_of(map, map.points_of(keyframes));
}

}  // namespace dkb
