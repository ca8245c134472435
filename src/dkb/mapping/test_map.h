// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/keyframe_packet.h"
#include "dkb/map/map.h"
#include "dkb/matching/test_scene.h"

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
          map.add_point(std::move(p));
        }
        map.observe(point, id, static_cast<int>(f));
      }
    }
    for (KeyframeId k = 0; k < map.keyframe_count(); ++k) map.update_covisibility(k, 15);
  }
};

// Makes the packets that tracking would send for views of a scene: each keyframe hangs on the one before it, shows the
// points that the scene's points were named before, and makes points of the rest.
struct PacketSource {
  // `matched` tells which scene points tracking matched.
  template <class Matched>
  KeyframePacket packet(const Rigid3& truth, const Rigid3& estimate, const ViewOptions& options, Matched&& matched) {
    KeyframePacket p;
    p.id = static_cast<KeyframeId>(shows.size());
    p.frame = 10 * p.id;
    p.timestamp = p.frame / 30.0;
    const View view = scene.look(truth, options);
    shows.push_back(view.shows);
    p.features = view.features;
    p.reference = p.id - 1;
    p.cam_from_reference = p.id == 0 ? estimate : estimate * estimates.back().inverse();
    estimates.push_back(estimate);
    p.points.assign(view.shows.size(), kNoPoint);
    for (size_t f = 0; f < view.shows.size(); ++f) {
      const int i = view.shows[f];
      if (i < 0) continue;
      if (id_of[static_cast<size_t>(i)] != kNoPoint && matched(i)) {
        p.points[f] = id_of[static_cast<size_t>(i)];
        continue;
      }
      const Keypoint& k = view.features->keypoints[f];
      if (!(k.depth > 0)) continue;
      ProvisionalPoint n;
      n.id = make_point_id(p.id, static_cast<int>(f));
      n.point_in_keyframe = scene.camera.unproject(k.pixel.cast<double>(), k.depth);
      n.scale = static_cast<float>(std::pow(TestScene::kScaleFactor, k.octave));
      n.descriptor = view.features->descriptors[f];
      p.new_points.push_back(n);
      if (id_of[static_cast<size_t>(i)] == kNoPoint) id_of[static_cast<size_t>(i)] = n.id;
    }
    return p;
  }
  KeyframePacket packet(const Rigid3& truth, const ViewOptions& options = {}) {
    return packet(truth, truth, options, [](int) { return true; });
  }
  // The scene's point behind a map point, by the keyframe and feature that it is named after.
  int shown_by(PointId id) const {
    return shows[static_cast<size_t>(birth_keyframe(id))][static_cast<size_t>(birth_feature(id))];
  }

  TestScene scene{400};
  std::vector<std::vector<int>> shows;
  std::vector<Rigid3> estimates;
  std::vector<PointId> id_of = std::vector<PointId>(400, kNoPoint);
};

}  // namespace dkb
