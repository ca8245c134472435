// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/ba_window.h"

#include "dkb/mapping/planes.h"
#include "dkb/util/chi_square.h"

namespace dkb {

BaWindow make_ba_window(const Map& map, std::vector<KeyframeId> keyframes, std::vector<uint8_t> fixed,
                        std::vector<PointId> points, const Optics& optics, bool planes) {
  BaWindow window;
  BaProblem& problem = window.problem;
  problem.camera = optics.camera;
  std::vector<int> camera_of(static_cast<size_t>(map.keyframe_count()), -1);
  window.keyframes = std::move(keyframes);
  problem.fixed = std::move(fixed);
  for (size_t c = 0; c < window.keyframes.size(); ++c) {
    camera_of[static_cast<size_t>(window.keyframes[c])] = static_cast<int>(c);
    problem.cam_from_world.push_back(map.keyframe(window.keyframes[c])->cam_from_world);
  }

  for (size_t c = 0; c < window.keyframes.size(); ++c) {
    const auto& motion = map.keyframe(window.keyframes[c])->motion;
    const int previous = motion ? camera_of[static_cast<size_t>(motion->previous)] : -1;
    if (previous >= 0 && !(problem.fixed[c] && problem.fixed[static_cast<size_t>(previous)]))
      problem.motions.push_back(
          {static_cast<int>(c), previous, motion->since.previous_from_current, motion->information(), kChi2SixDof99});
  }

  if (planes) add_planes(map, window.keyframes, problem);

  window.points = std::move(points);
  // Room for what comes and no more: in a large map half of it again would be some megabytes.
  size_t observed = 0;
  for (const PointId p : window.points)
    for (const Observation& o : map.point(p)->observations) observed += camera_of[static_cast<size_t>(o.keyframe)] >= 0;
  problem.points.reserve(window.points.size());
  problem.observations.reserve(observed);
  for (size_t p = 0; p < window.points.size(); ++p) {
    const MapPoint& point = *map.point(window.points[p]);
    problem.points.push_back(point.position);
    for (const Observation& o : point.observations) {
      const int c = camera_of[static_cast<size_t>(o.keyframe)];
      if (c < 0) continue;
      const Keypoint& k = map.keyframe(o.keyframe)->features->keypoints[static_cast<size_t>(o.feature)];
      BaObservation observation;
      observation.camera = c;
      observation.point = static_cast<int>(p);
      observation.u = k.pixel.x();
      observation.v = k.pixel.y();
      observation.inv_sigma = 1 / optics.corner_sigma(k);
      observation.depth = k.depth;
      if (k.depth > 0) observation.inv_depth_sigma = 1.0 / optics.noise.depth_sigma(k.depth);
      problem.observations.push_back(observation);
    }
  }
  return window;
}

}  // namespace dkb
