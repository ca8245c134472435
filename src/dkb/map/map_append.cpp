// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "dkb/map/map.h"
#include "dkb/util/errors.h"

namespace dkb {

void Map::append(const Map& other) {
  const KeyframeId shift = keyframe_count();
  const auto plane_shift = static_cast<PlaneId>(joined_to_.size());
  if (shift + other.keyframe_count() > birth_keyframe(kNoPoint))
    throw InputError("the two maps have more keyframes than one map can hold");
  FrameIndex newest = -1, oldest = 0;
  std::vector<Keyframe> keyframes;
  for (KeyframeId id = 0; id < shift; ++id) {
    keyframes.push_back(*keyframe(id));
    newest = std::max(newest, keyframes.back().frame);
  }
  for (KeyframeId id = 0; id < other.keyframe_count(); ++id) oldest = std::min(oldest, other.keyframe(id)->frame);
  const auto renamed = [shift](PointId id) {
    return id == kNoPoint ? id : make_point_id(birth_keyframe(id) + shift, birth_feature(id));
  };
  for (KeyframeId id = 0; id < other.keyframe_count(); ++id) {
    Keyframe k = *other.keyframe(id);
    k.id += shift;
    k.frame += newest + 1 - oldest;
    if (k.parent != kNoKeyframe) k.parent += shift;
    if (k.motion)
      k.motion = std::make_shared<const KeyframeMotion>(KeyframeMotion{k.motion->previous + shift, k.motion->since});
    for (PointId& p : k.points) p = renamed(p);
    for (PlaneId& p : k.plane_of_patch) p += plane_shift;
    for (Covisible& c : k.covisible) c.keyframe += shift;
    keyframes.push_back(std::move(k));
  }
  std::vector<MapPoint> points;
  std::vector<RemovedPoint> removed = removed_points();
  for (PointId id : live_points()) points.push_back(*point(id));
  for (PointId id : other.live_points()) {
    points.push_back(*other.point(id));
    points.back().id = renamed(id);
  }
  for (const RemovedPoint& r : other.removed_points()) removed.push_back({renamed(r.id), renamed(r.replaced_by)});
  std::vector<PlaneId> joined_to = joined_to_;
  for (PlaneId p : other.joined_to_) joined_to.push_back(p + plane_shift);
  *this = restore(std::move(keyframes), std::move(points), std::move(removed));
  joined_to_ = std::move(joined_to);
}

}  // namespace dkb
