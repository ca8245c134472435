// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/map_correction.h"

#include <algorithm>
#include <optional>

namespace dkb {
namespace {

// Makes `joint` the root of its tree: the path up from it is reversed.
void hang_tree(Map& map, KeyframeId joint, KeyframeId parent) {
  std::vector<KeyframeId> path;
  for (KeyframeId k = joint; k != kNoKeyframe; k = map.keyframe(k)->parent) path.push_back(k);
  map.set_parent(joint, parent);
  for (size_t i = 1; i < path.size(); ++i) map.set_parent(path[i], path[i - 1]);
}

bool same(const Rigid3& a, const Rigid3& b) {
  return a.translation == b.translation && a.rotation.coeffs() == b.rotation.coeffs();
}

}  // namespace

void move_map(Map& map, const MapCorrection& correction) {
  const auto count = static_cast<size_t>(map.keyframe_count());
  const bool adjusts = correction.kind == MapCorrection::Kind::adjustment;
  // How the world moves at each keyframe: new_world_from_old_world.
  std::vector<std::optional<Rigid3>> motion(count);
  std::vector<uint8_t> done(count, 0);  // by 1: each is asked once, however long the way to a root
  for (const MapCorrection::Pose& p : correction.poses) {
    const Keyframe* k = map.live_keyframe(p.keyframe);
    if (k == nullptr) continue;
    // What an adjustment leaves where it was is not touched, nor what hangs on it.
    done[static_cast<size_t>(p.keyframe)] = adjusts && same(p.before, p.after);
    if (done[static_cast<size_t>(p.keyframe)]) continue;
    const Rigid3 after = adjusts ? p.after : k->cam_from_world * p.before.inverse() * p.after;
    motion[static_cast<size_t>(p.keyframe)] = after.inverse() * k->cam_from_world;
  }
  // The others move as the nearest ancestor does that has a correction; trees without one stay.
  for (size_t k = 0; k < count; ++k) {
    std::vector<size_t> path;
    KeyframeId at = static_cast<KeyframeId>(k);
    while (at != kNoKeyframe && !motion[static_cast<size_t>(at)] && !done[static_cast<size_t>(at)]) {
      path.push_back(static_cast<size_t>(at));
      at = map.keyframe(at)->parent;
    }
    for (size_t w : path) {
      done[w] = 1;
      if (at != kNoKeyframe) motion[w] = motion[static_cast<size_t>(at)];
    }
  }

  size_t next = 0;
  for (PointId id : map.live_points()) {
    while (next < correction.positions.size() && correction.positions[next].point < id) ++next;
    const bool own = next < correction.positions.size() && correction.positions[next].point == id;
    const MapPoint& p = *map.point(id);
    KeyframeId guide = birth_keyframe(id);
    if (map.live_keyframe(guide) == nullptr && !p.observations.empty()) guide = p.observations.front().keyframe;
    if (!motion[static_cast<size_t>(guide)] && !(adjusts && own)) continue;
    const Rigid3 moves = motion[static_cast<size_t>(guide)].value_or(Rigid3());
    MapPoint& moved = map.edit_point(id);
    if (own) {
      const MapCorrection::Position& c = correction.positions[next];
      moved.position = adjusts ? c.after : Eigen::Vector3d(c.after + moves.rotation * (moved.position - c.before));
    } else {
      moved.position = moves * moved.position;
    }
    moved.normal = (moves.rotation * moved.normal.cast<double>()).cast<float>();
  }
  for (KeyframeId id : map.live_keyframes()) {
    if (!motion[static_cast<size_t>(id)]) continue;
    map.set_pose(id, map.keyframe(id)->cam_from_world * motion[static_cast<size_t>(id)]->inverse());
    if (correction.near_joint != kNoKeyframe)
      map.set_covariance(
          id, map.keyframe(id)->covariance + carried(map.keyframe(id)->cam_from_world, correction.joint_covariance));
  }
  for (const MapCorrection::Outlier& s : correction.outliers)
    if (map.point(s.point) != nullptr) map.forget(s.point, s.keyframe);  // what it was fused into may be right there
  if (correction.near_joint != kNoKeyframe) {
    const KeyframeId near = map.live_ancestor(correction.near_joint).id,
                     far = map.live_ancestor(correction.far_joint).id;
    if (map.root(near) != map.root(far)) hang_tree(map, near, far);
  }
}

}  // namespace dkb
