// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/global_adjustment.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "dkb/mapping/ba_window.h"
#include "dkb/solver/geometric_weights.h"

namespace dkb {
namespace {

// The live keyframes nearest to the newest one by covisibility, increasing: as many as have that many neighbours
// together.
std::vector<KeyframeId> nearest_keyframes(const Map& map, size_t most_neighbours) {
  std::vector<KeyframeId> nearest = map.live_keyframes();
  const auto neighbours = [&map](KeyframeId k) { return map.keyframe(k)->covisible.size(); };
  size_t sum = 0;
  for (KeyframeId k : nearest) sum += neighbours(k);
  if (sum <= most_neighbours) return nearest;
  nearest.erase(nearest.begin(), nearest.end() - 1);
  sum = neighbours(nearest[0]);
  std::vector<uint8_t> seen(static_cast<size_t>(map.keyframe_count()), 0);
  seen[static_cast<size_t>(nearest[0])] = 1;
  for (size_t next = 0; next < nearest.size(); ++next)
    for (const Covisible& c : map.keyframe(nearest[next])->covisible) {
      if (seen[static_cast<size_t>(c.keyframe)] || sum + neighbours(c.keyframe) > most_neighbours) continue;
      seen[static_cast<size_t>(c.keyframe)] = 1;
      sum += neighbours(c.keyframe);
      nearest.push_back(c.keyframe);
    }
  std::sort(nearest.begin(), nearest.end());
  return nearest;
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
        k.parent == kNoKeyframe || (k.motion && left_out(k.motion->previous)) || left_out(map.moved_on_from(id)) ||
        std::any_of(k.covisible.begin(), k.covisible.end(), [&](const Covisible& c) { return left_out(c.keyframe); }));
  }
  if (std::find(fixed.begin(), fixed.end(), 1) == fixed.end()) fixed.front() = 1;
  return fixed;
}

}  // namespace

MapCorrection adjust_globally(const Map& map, const Optics& optics, const LocalBaOptions& local,
                              size_t most_neighbours) {
  MapCorrection correction;
  const std::vector<KeyframeId> keyframes = nearest_keyframes(map, most_neighbours);
  if (keyframes.size() < 2) return correction;
  std::vector<uint8_t> fixed = those_that_stay(map, keyframes);
  // Points of one observation tie nothing together; they follow their keyframe.
  std::vector<PointId> points = map.points_of(keyframes);
  std::erase_if(points, [&](PointId p) { return map.point(p)->observations.size() < 2; });
  BaWindow window = make_ba_window(map, keyframes, std::move(fixed), std::move(points), optics);
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
  for (size_t o = 0; o < window.sources.size(); ++o)
    if (result.outlier[o])
      correction.outliers.push_back(
          {window.points[static_cast<size_t>(window.sources[o].point)], window.sources[o].keyframe});
  return correction;
}

}  // namespace dkb
