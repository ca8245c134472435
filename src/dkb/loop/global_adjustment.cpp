// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/global_adjustment.h"

#include "dkb/mapping/ba_window.h"
#include "dkb/solver/geometric_weights.h"

namespace dkb {

MapCorrection adjust_globally(const Map& map, const Optics& optics, const LocalBaOptions& local) {
  MapCorrection correction;
  const std::vector<KeyframeId> keyframes = map.live_keyframes();
  if (keyframes.size() < 2) return correction;
  std::vector<uint8_t> fixed;
  for (KeyframeId k : keyframes) fixed.push_back(map.keyframe(k)->parent == kNoKeyframe);
  // Points of one observation tie nothing together; they follow their keyframe.
  std::vector<PointId> points;
  for (PointId p : map.live_points())
    if (map.point(p)->observations.size() >= 2) points.push_back(p);
  BaWindow window = make_ba_window(map, keyframes, std::move(fixed), std::move(points), optics.camera, optics.noise,
                                   optics.scale_factor);
  if (local.weighted) set_geometric_weights(window.problem, local.weights);
  BaOptions ba;
  ba.rounds = {5, 10};  // [steps] before and after outliers are told apart
  const BaResult result = bundle_adjust(window.problem, ba);

  for (size_t c = 0; c < window.keyframes.size(); ++c)
    correction.poses.push_back(
        {window.keyframes[c], map.keyframe(window.keyframes[c])->cam_from_world, window.problem.cam_from_world[c]});
  for (size_t p = 0; p < window.points.size(); ++p)
    correction.positions.push_back({window.points[p], map.point(window.points[p])->position, window.problem.points[p]});
  for (size_t o = 0; o < window.sources.size(); ++o)
    if (result.outlier[o])
      correction.outliers.push_back(
          {window.points[static_cast<size_t>(window.sources[o].point)], window.sources[o].keyframe});
  return correction;
}

}  // namespace dkb
