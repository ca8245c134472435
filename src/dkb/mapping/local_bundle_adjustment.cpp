// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/local_bundle_adjustment.h"

#include <algorithm>
#include <cmath>

#include "dkb/util/errors.h"

namespace dkb {

void LocalBaOptions::check() const {
  require_option(free_keyframes >= 1, "free_keyframes", free_keyframes, "at least 1");
  require_option(fixed_keyframes >= 1, "fixed_keyframes", fixed_keyframes, "at least 1");
  require_option(iterations_first >= 1, "iterations_first", iterations_first, "at least 1");
  require_option(iterations_second >= 1, "iterations_second", iterations_second, "at least 1");
  weights.check();
}

LocalBaReport local_bundle_adjustment(Map& map, KeyframeId newest, const CameraModel& camera, const SensorNoise& noise,
                                      double scale_factor, const LocalBaOptions& options) {
  LocalBaReport report;
  std::vector<KeyframeId> keyframes = {newest};
  for (const Covisible& c : map.keyframe(newest)->covisible)
    if (static_cast<int>(keyframes.size()) < options.free_keyframes) keyframes.push_back(c.keyframe);
  std::sort(keyframes.begin(), keyframes.end());

  std::vector<PointId> points;
  for (KeyframeId k : keyframes)
    for (PointId p : map.keyframe(k)->points)
      if (p != kNoPoint) points.push_back(p);
  std::sort(points.begin(), points.end());
  points.erase(std::unique(points.begin(), points.end()), points.end());

  std::vector<Covisible> around;  // keyframes outside the window, by how many of its points they see
  {
    std::vector<int> count(static_cast<size_t>(map.keyframe_count()), 0);
    for (PointId p : points)
      for (const Observation& o : map.point(p)->observations) ++count[static_cast<size_t>(o.keyframe)];
    for (KeyframeId k : keyframes) count[static_cast<size_t>(k)] = 0;
    for (size_t k = 0; k < count.size(); ++k)
      if (count[k] > 0) around.push_back({static_cast<KeyframeId>(k), count[k]});
    std::stable_sort(around.begin(), around.end(),
                     [](const Covisible& a, const Covisible& b) { return a.shared_points > b.shared_points; });
    if (static_cast<int>(around.size()) > options.fixed_keyframes)
      around.resize(static_cast<size_t>(options.fixed_keyframes));
  }

  BaProblem problem;
  problem.camera = camera;
  std::vector<int> camera_of(static_cast<size_t>(map.keyframe_count()), -1);
  std::vector<KeyframeId> keyframe_of;
  const auto add_camera = [&](KeyframeId k, bool fixed) {
    camera_of[static_cast<size_t>(k)] = static_cast<int>(keyframe_of.size());
    keyframe_of.push_back(k);
    problem.cam_from_world.push_back(map.keyframe(k)->cam_from_world);
    problem.fixed.push_back(fixed);
  };
  for (KeyframeId k : keyframes) add_camera(k, map.keyframe(k)->parent == kNoKeyframe);
  for (const Covisible& c : around) add_camera(c.keyframe, true);
  if (std::none_of(problem.fixed.begin(), problem.fixed.end(), [](uint8_t f) { return f != 0; })) problem.fixed[0] = 1;

  std::vector<double> inv_sigma(32);
  for (int l = 0; l < 32; ++l) inv_sigma[static_cast<size_t>(l)] = 1.0 / noise.corner_sigma(l, scale_factor);
  std::vector<Observation> sources;
  for (size_t p = 0; p < points.size(); ++p) {
    const MapPoint& point = *map.point(points[p]);
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
      observation.inv_sigma = inv_sigma[k.octave];
      observation.depth = k.depth;
      if (k.depth > 0) observation.inv_depth_sigma = 1.0 / noise.depth_sigma(k.depth);
      problem.observations.push_back(observation);
      sources.push_back({o.keyframe, static_cast<int32_t>(p)});
    }
  }
  if (options.weighted) set_geometric_weights(problem, options.weights);

  BaOptions ba;
  ba.rounds = {options.iterations_first, options.iterations_second};
  ba.prefilter = options.weighted;  // DKB section 3.3 leaves gross errors out beforehand
  const BaResult result = bundle_adjust(problem, ba);

  for (size_t c = 0; c < keyframe_of.size(); ++c)
    if (!problem.fixed[c]) map.set_pose(keyframe_of[c], problem.cam_from_world[c]);
  for (size_t p = 0; p < points.size(); ++p) map.edit_point(points[p]).position = problem.points[p];
  for (size_t o = 0; o < sources.size(); ++o)
    if (result.outlier[o]) map.forget(points[static_cast<size_t>(sources[o].feature)], sources[o].keyframe);

  report.cameras = static_cast<int>(std::count(problem.fixed.begin(), problem.fixed.end(), uint8_t{0}));
  report.fixed = static_cast<int>(keyframe_of.size()) - report.cameras;
  report.points = static_cast<int>(points.size());
  report.observations = static_cast<int>(sources.size());
  report.outliers = result.outliers;
  report.iterations = result.iterations;
  report.initial_cost = result.initial_cost;
  report.final_cost = result.final_cost;
  report.moved_points = std::move(points);
  return report;
}

}  // namespace dkb
