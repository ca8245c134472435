// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/loop_correction.h"

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

#include "dkb/solver/bundle_adjustment.h"

namespace dkb {
namespace {

PoseEdge graph_edge(int a, int b, const Rigid3& b_from_a, int shared_points) {
  PoseEdge e;
  e.a = a;
  e.b = b;
  e.b_from_a = b_from_a;
  e.information = edge_covariance(b_from_a, shared_points).diagonal().cwiseInverse().asDiagonal();
  return e;
}

void move_by_pose_graph(const Map& map, const LoopFinding& finding, MapCorrection& correction) {
  const KeyframeId far = finding.far_area.front(), root = map.root(far);
  BaProblem graph;
  std::vector<int> node(static_cast<size_t>(map.keyframe_count()), -1);
  std::vector<KeyframeId> keyframes;
  const std::vector<KeyframeId> root_of = map.root_of_each();
  for (KeyframeId k : map.live_keyframes()) {
    if (root_of[static_cast<size_t>(k)] != root) continue;
    node[static_cast<size_t>(k)] = static_cast<int>(keyframes.size());
    keyframes.push_back(k);
    graph.cam_from_world.push_back(map.keyframe(k)->cam_from_world);
    graph.fixed.push_back(k == root);
  }
  const auto relative = [&](KeyframeId a, KeyframeId b) {
    return map.keyframe(b)->cam_from_world * map.keyframe(a)->cam_from_world.inverse();
  };
  const auto add = [&](KeyframeId a, KeyframeId b, const Rigid3& b_from_a, int shared) {
    const int from = node[static_cast<size_t>(a)], to = node[static_cast<size_t>(b)];
    if (from >= 0 && to >= 0) graph.motions.push_back(graph_edge(from, to, b_from_a, shared));
  };
  std::vector<std::pair<KeyframeId, KeyframeId>> seams;  // that the essential graph has not
  for (KeyframeId id : keyframes) {
    const Keyframe& k = *map.keyframe(id);
    const int previous = k.motion ? node[static_cast<size_t>(k.motion->previous)] : -1;
    // Where no point ties two keyframes, what the camera did between them is all that does: their pose in the map holds
    // as firmly as that motion was known.
    if (previous >= 0)
      graph.motions.push_back(
          {node[static_cast<size_t>(id)], previous, relative(id, k.motion->previous), k.motion->information()});
    const int shared = points_shared_with(k.parent, k.covisible);
    // Parents are older but where two maps were joined: without the edge to a younger one the graph may fall apart.
    if (k.parent != kNoKeyframe && (shared > 0 || previous < 0 || k.parent > id))
      add(k.parent, id, relative(k.parent, id), shared);
    const auto in_tree = [&](const Covisible& c) {
      return c.keyframe == k.parent || map.keyframe(c.keyframe)->parent == id;
    };
    for (const Covisible& c : k.covisible)
      if (c.keyframe > id && c.shared_points >= kEssentialSharedPoints && !in_tree(c))
        add(id, c.keyframe, relative(id, c.keyframe), c.shared_points);
    // A loop that was closed before holds by whom a keyframe shares most points with of those that it does not follow.
    const auto seam = std::find_if(k.covisible.begin(), k.covisible.end(), [id](const Covisible& c) {
      return std::abs(c.keyframe - id) >= kMinKeyframesBetween;
    });
    if (seam != k.covisible.end() && seam->shared_points < kEssentialSharedPoints && !in_tree(*seam))
      seams.push_back(std::minmax(id, seam->keyframe));
  }
  std::sort(seams.begin(), seams.end());
  seams.erase(std::unique(seams.begin(), seams.end()), seams.end());
  for (const auto& [a, b] : seams) add(a, b, relative(a, b), points_shared_with(b, map.keyframe(a)->covisible));
  const Rigid3 world_from_far = map.keyframe(far)->cam_from_world.inverse();
  for (const LoopFinding::Support& s : finding.support)
    add(far, s.keyframe, s.fit.cam_from_world * world_from_far, s.fit.inliers);
  bundle_adjust(graph, BaOptions::of_pose_graph());
  for (size_t n = 0; n < keyframes.size(); ++n)
    correction.poses.push_back({keyframes[n], map.keyframe(keyframes[n])->cam_from_world, graph.cam_from_world[n]});
}

}  // namespace

MapCorrection correct_loop(const Map& map, const LoopFinding& finding) {
  MapCorrection correction;
  correction.kind = finding.merge ? MapCorrection::Kind::merge : MapCorrection::Kind::loop;
  correction.far_side = finding.far_area;
  for (const LoopFinding::Support& s : finding.support) {
    correction.near_side.push_back(s.keyframe);
    const Keyframe& k = *map.keyframe(s.keyframe);
    for (size_t f = 0; f < s.fit.points.size(); ++f)
      if (const PointId point = s.fit.points[f], own = k.points[f];
          own != kNoPoint && point != kNoPoint && own != point)
        correction.same.emplace_back(own, point);
  }
  const KeyframeId near = finding.support.front().keyframe, far = finding.far_area.front();
  if (!finding.merge) {
    move_by_pose_graph(map, finding, correction);
    return correction;
  }
  const PlaceFit& fit = finding.support.front().fit;
  Rigid3 moved_from_world = fit.cam_from_world.inverse() * map.keyframe(near)->cam_from_world;
  Rigid3 near_cam_from_world = fit.cam_from_world;  // in the older map's world
  correction.near_joint = near;
  correction.far_joint = far;
  if (map.root(near) < map.root(far)) {  // the older map stays
    std::swap(correction.near_joint, correction.far_joint);
    moved_from_world = moved_from_world.inverse();
    near_cam_from_world = map.keyframe(near)->cam_from_world;
  }
  const Keyframe& stays = *map.keyframe(correction.far_joint);
  correction.joint_covariance = carried(stays.cam_from_world.inverse(), stays.covariance) +
                                carried(near_cam_from_world.inverse(), fit.covariance);
  const std::vector<KeyframeId> root_of = map.root_of_each();
  const KeyframeId moving = root_of[static_cast<size_t>(correction.near_joint)];
  for (KeyframeId id : map.live_keyframes()) {
    if (root_of[static_cast<size_t>(id)] != moving) continue;
    const Rigid3& before = map.keyframe(id)->cam_from_world;
    correction.poses.push_back({id, before, before * moved_from_world.inverse()});
  }
  return correction;
}

}  // namespace dkb
