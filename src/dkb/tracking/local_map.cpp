// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/local_map.h"

#include <algorithm>

namespace dkb {
namespace {

constexpr size_t kVotedKeyframes = 30;   // that share most points with the frame
constexpr size_t kNeighboursOfEach = 5;  // covisible keyframes added for each of them
constexpr size_t kKeyframes = 60;        // at most, in all

}  // namespace

std::vector<Candidate> local_map_candidates(const std::vector<PointId>& points, const Map& map) {
  const auto ranked = map.observers_of(points);
  std::vector<KeyframeId> keyframes;
  const auto add = [&](KeyframeId id) {
    if (keyframes.size() < kKeyframes && std::find(keyframes.begin(), keyframes.end(), id) == keyframes.end())
      keyframes.push_back(id);
  };
  const size_t voted = std::min(ranked.size(), kVotedKeyframes);
  for (size_t i = 0; i < voted; ++i) add(ranked[i].keyframe);
  for (size_t i = 0; i < voted; ++i) {
    const auto& neighbours = map.keyframe(ranked[i].keyframe)->covisible;
    for (size_t n = 0; n < std::min(neighbours.size(), kNeighboursOfEach); ++n) add(neighbours[n].keyframe);
  }
  return candidates_of(map, map.points_of(keyframes));
}

}  // namespace dkb
