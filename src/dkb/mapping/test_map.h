// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/map.h"
#include "dkb/tracking/frame.h"
#include "dkb/tracking/test_scene.h"

namespace dkb {

// Adds a keyframe that sees `view` from `cam_from_world`, showing no points yet.
inline KeyframeId add_view(Map& map, const View& view, const Rigid3& cam_from_world) {
  Keyframe k;
  k.id = map.keyframe_count();
  k.frame = 10 * k.id;
  k.features = view.features;
  k.cam_from_world = cam_from_world;
  k.points.assign(view.features->size(), kNoPoint);
  k.parent = k.id - 1;  // kNoKeyframe for the first
  const KeyframeId id = k.id;
  map.add_keyframe(std::move(k));
  return id;
}

// The map of a scene seen in several views, without mapping: each point stands where `where(scene point)` says, is
// named after the first keyframe that sees it, and is observed by every keyframe that does.
struct SceneMap {
  Map map;
  std::vector<PointId> id_of;  // per point of the scene; kNoPoint where nobody sees it

  template <class Where>
  SceneMap(const TestScene& scene, const std::vector<View>& views, const std::vector<Rigid3>& poses, Where&& where)
      : id_of(scene.points.size(), kNoPoint) {
    for (size_t k = 0; k < views.size(); ++k) {
      const KeyframeId id = add_view(map, views[k], poses[k]);
      for (size_t f = 0; f < views[k].shows.size(); ++f) {
        const int shows = views[k].shows[f];
        if (shows < 0) continue;
        PointId& point = id_of[static_cast<size_t>(shows)];
        if (point == kNoPoint) {
          MapPoint p;
          p.id = point = make_point_id(id, static_cast<int>(f));
          p.position = where(shows);
          p.born_at = id;
          map.add_point(std::move(p));
        }
        map.observe(point, id, static_cast<int>(f));
      }
    }
    for (KeyframeId k = 0; k < map.keyframe_count(); ++k) map.update_covisibility(k, 15);
  }
};

}  // namespace dkb
