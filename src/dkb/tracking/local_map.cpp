// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/local_map.h"

#include <algorithm>

namespace dkb {
namespace {

std::vector<Covisible> votes_of(const std::vector<PointId>& points, const Map& map) {
  std::vector<int> votes(static_cast<size_t>(map.keyframe_count()), 0);
  for (PointId id : points)
    if (const MapPoint* p = map.point(id))
      for (const Observation& o : p->observations) ++votes[static_cast<size_t>(o.keyframe)];
  std::vector<Covisible> ranked;
  for (size_t k = 0; k < votes.size(); ++k)
    if (votes[k] > 0) ranked.push_back({static_cast<KeyframeId>(k), votes[k]});
  std::stable_sort(ranked.begin(), ranked.end(),
                   [](const Covisible& a, const Covisible& b) { return a.shared_points > b.shared_points; });
  return ranked;
}

}  // namespace

KeyframeId keyframe_sharing_most(const std::vector<PointId>& points, const Map& map) {
  const auto ranked = votes_of(points, map);
  return ranked.empty() ? kNoKeyframe : ranked.front().keyframe;
}

std::vector<Candidate> local_map_candidates(const std::vector<PointId>& points, const Map& map,
                                            const LocalMapOptions& options) {
  const auto ranked = votes_of(points, map);
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
