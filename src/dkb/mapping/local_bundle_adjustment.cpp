// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/local_bundle_adjustment.h"

#include <algorithm>
#include <cmath>

#include "dkb/mapping/ba_window.h"

namespace dkb {
namespace {

// What the fixed keyframes of a window are off by, which the window's own follow: the mean of their covariances, each
// by its part of what is observed. Nobody knows how much of their errors they share; all of it is the worst case. Left
// perturbation of world_from_cam.
Matrix6d common_error(const Map& map, const BaWindow& window, const BaResult& result) {
  std::vector<int> observed(window.keyframes.size(), 0);
  for (size_t o = 0; o < window.problem.observations.size(); ++o) {
    const auto c = static_cast<size_t>(window.problem.observations[o].camera);
    observed[c] += window.problem.fixed[c] && !result.outlier[o];
  }
  // The six numbers of a motion tell as much as three pixels.
  for (const PoseEdge& motion : window.problem.motions)
    for (const int end : {motion.a, motion.b})
      if (const auto c = static_cast<size_t>(end); c < observed.size() && window.problem.fixed[c]) observed[c] += 3;
  Matrix6d sum = Matrix6d::Zero();
  int all = 0;
  for (size_t c = 0; c < window.keyframes.size(); ++c) {
    if (observed[c] == 0) continue;
    const Matrix6d to_world = adjoint(window.problem.cam_from_world[c].inverse());
    sum += observed[c] * to_world * map.keyframe(window.keyframes[c])->covariance * to_world.transpose();
    all += observed[c];
  }
  return sum / std::max(all, 1);
}

}  // namespace

std::vector<PointId> local_bundle_adjustment(Map& map, KeyframeId newest, const Optics& optics,
                                             const LocalBaOptions& options) {
  std::vector<KeyframeId> keyframes = map.best_covisible(newest, static_cast<size_t>(options.free_keyframes - 1));
  keyframes.push_back(newest);
  std::sort(keyframes.begin(), keyframes.end());

  std::vector<PointId> points = map.points_of(keyframes);
  const auto in_window = [&](KeyframeId k) { return std::binary_search(keyframes.begin(), keyframes.end(), k); };
  std::vector<Covisible> around = map.observers_of(points);  // outside the window
  std::erase_if(around, [&](const Covisible& c) { return in_window(c.keyframe); });
  around.resize(std::min(around.size(), static_cast<size_t>(options.fixed_keyframes)));

  // A keyframe that a motion joins to the window holds it too, though they may share no point.
  for (KeyframeId k : keyframes) {
    std::vector<KeyframeId> joined_to = map.keyframe(k)->followers;
    if (const auto& motion = map.keyframe(k)->motion) joined_to.insert(joined_to.begin(), motion->previous);
    for (const KeyframeId other : joined_to)
      if (map.live_keyframe(other) != nullptr && !in_window(other) &&
          std::none_of(around.begin(), around.end(), [other](const Covisible& c) { return c.keyframe == other; }))
        around.push_back({other, 0});
  }

  std::vector<uint8_t> fixed;
  for (KeyframeId k : keyframes) fixed.push_back(map.keyframe(k)->parent == kNoKeyframe);
  for (const Covisible& c : around) {
    keyframes.push_back(c.keyframe);
    fixed.push_back(1);
  }
  if (std::none_of(fixed.begin(), fixed.end(), [](uint8_t f) { return f != 0; })) fixed[0] = 1;
  BaWindow window =
      make_ba_window(map, std::move(keyframes), std::move(fixed), std::move(points), optics, options.planes);
  BaProblem& problem = window.problem;
  if (options.weighted) set_geometric_weights(problem, options.weights);

  BaOptions ba;
  ba.rounds = {4, 6};               // [steps] before and after outliers are told apart
  ba.prefilter = options.weighted;  // DKB section 3.3 leaves gross errors out beforehand
  // Of a cost of some thousands, one for each degree of freedom: a step that saves half of one is within the noise.
  ba.relative_tolerance = 1e-4;
  problem.asked = window.camera_of(newest);
  const BaResult result = bundle_adjust(problem, ba);

  for (size_t c = 0; c < window.keyframes.size(); ++c)
    if (!problem.fixed[c]) map.set_pose(window.keyframes[c], problem.cam_from_world[c]);
  if (result.covariance)
    map.set_covariance(newest, *result.covariance + carried(problem.cam_from_world[static_cast<size_t>(problem.asked)],
                                                            common_error(map, window, result)));
  for (size_t p = 0; p < window.points.size(); ++p) map.edit_point(window.points[p]).position = problem.points[p];
  for (size_t o = 0; o < problem.observations.size(); ++o)
    if (result.outlier[o]) map.forget(window.point_of(o), window.keyframe_of(o));
  return std::move(window.points);
}

}  // namespace dkb
