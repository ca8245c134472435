// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/global_adjustment.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "dkb/mapping/ba_window.h"
#include "dkb/solver/geometric_weights.h"

namespace dkb {
namespace {

// The live keyframes around `places`, all at once, increasing: as many as have that many neighbours together. They are
// sought along all that holds keyframes together: points, motions, and the tree where there is neither. Without places
// those of each map around its newest one, the map of the newest of all first.
std::vector<KeyframeId> keyframes_around(const Map& map, const std::vector<KeyframeId>& places,
                                         size_t most_neighbours) {
  std::vector<KeyframeId> taken;
  std::vector<KeyframeId> starts = map.live_keyframes();
  std::reverse(starts.begin(), starts.end());

  std::vector<uint8_t> seen(static_cast<size_t>(map.keyframe_count()), 0);
  size_t sum = 0;
  const auto take = [&](KeyframeId id) {
    const Keyframe* k = map.live_keyframe(id);
    if (k == nullptr || seen[static_cast<size_t>(id)]) return;
    if (!taken.empty() && sum + k->covisible.size() > most_neighbours) return;
    seen[static_cast<size_t>(id)] = 1;
    sum += k->covisible.size();
    taken.push_back(id);
  };
  if (!places.empty()) starts.clear();
  for (KeyframeId place : places) {
    starts.push_back(map.live_ancestor(place).id);
    take(starts.back());
  }
  size_t next = 0;
  for (KeyframeId s : starts) {
    take(s);
    for (; next < taken.size(); ++next) {
      const KeyframeId id = taken[next];
      const Keyframe& k = *map.keyframe(id);
      for (const Covisible& c : k.covisible) take(c.keyframe);
      if (k.motion) take(k.motion->previous);
      for (KeyframeId next_one : k.followers) take(next_one);
      take(k.parent);
      for (KeyframeId child : k.children) take(child);
    }
  }
  std::sort(taken.begin(), taken.end());
  return taken;
}

// The roots of maps, and what has neighbours, by points or by motion, that take no part.
std::vector<uint8_t> those_that_stay(const Map& map, const std::vector<KeyframeId>& keyframes) {
  const auto left_out = [&](KeyframeId k) {
    return k != kNoKeyframe && !std::binary_search(keyframes.begin(), keyframes.end(), k);
  };
  std::vector<uint8_t> fixed;
  for (KeyframeId id : keyframes) {
    const Keyframe& k = *map.keyframe(id);
    fixed.push_back(
        k.parent == kNoKeyframe || (k.motion && left_out(k.motion->previous)) ||
        std::any_of(k.followers.begin(), k.followers.end(), left_out) ||
        std::any_of(k.covisible.begin(), k.covisible.end(), [&](const Covisible& c) { return left_out(c.keyframe); }));
  }
  if (std::find(fixed.begin(), fixed.end(), 1) == fixed.end()) fixed.front() = 1;
  return fixed;
}

}  // namespace

MapCorrection adjust_globally(const Map& map, const Optics& optics, const LocalBaOptions& local,
                              const std::vector<KeyframeId>& around, size_t most_neighbours) {
  MapCorrection correction;
  const std::vector<KeyframeId> keyframes = keyframes_around(map, around, most_neighbours);
  if (keyframes.size() < 2) return correction;
  std::vector<uint8_t> fixed = those_that_stay(map, keyframes);
  std::vector<uint8_t> takes_part(static_cast<size_t>(map.keyframe_count()), 0);
  for (KeyframeId k : keyframes) takes_part[static_cast<size_t>(k)] = 1;
  // Points of one observation that takes part tie nothing together: they follow their keyframe, and do not move onto
  // it.
  std::vector<PointId> points = map.points_of(keyframes);
  std::erase_if(points, [&](PointId p) {
    int observed = 0;
    for (const Observation& o : map.point(p)->observations) observed += takes_part[static_cast<size_t>(o.keyframe)];
    return observed < 2;
  });
  BaWindow window = make_ba_window(map, keyframes, std::move(fixed), std::move(points), optics, local.planes);
  if (local.weighted) set_geometric_weights(window.problem, local.weights);
  BaOptions ba;
  ba.rounds = {5, 10};  // [steps] before and after outliers are told apart
  const BaResult result = bundle_adjust(window.problem, ba);

  for (size_t c = 0; c < window.keyframes.size(); ++c)
    correction.poses.push_back(
        {window.keyframes[c], map.keyframe(window.keyframes[c])->cam_from_world, window.problem.cam_from_world[c]});
  // What takes no part stays: it is not what hangs on those that do.
  for (KeyframeId k : map.live_keyframes())
    if (!std::binary_search(keyframes.begin(), keyframes.end(), k))
      correction.poses.push_back({k, map.keyframe(k)->cam_from_world, map.keyframe(k)->cam_from_world});
  for (size_t p = 0; p < window.points.size(); ++p)
    correction.positions.push_back({window.points[p], map.point(window.points[p])->position, window.problem.points[p]});
  for (size_t o = 0; o < window.problem.observations.size(); ++o)
    if (result.outlier[o]) correction.outliers.push_back({window.point_of(o), window.keyframe_of(o)});
  return correction;
}

}  // namespace dkb
