// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "dkb/features/plane_finder.h"
#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/map/ids.h"
#include "dkb/map/keyframe_motion.h"
#include "dkb/place/copy_epoch.h"
#include "dkb/place/place_index.h"

namespace dkb {

// One observation of a map point.
struct Observation {
  KeyframeId keyframe = kNoKeyframe;
  int32_t feature = 0;
  bool operator==(const Observation&) const = default;
};

struct MapPoint {
  PointId id = kNoPoint;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  // [m] in the world
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();    // mean unit direction from the point to the cameras that see it
  float reference_distance = 0;                        // [m] from the camera that gave the descriptor
  float reference_scale = 1;                           // pyramid scale of the feature that gave the descriptor
  Descriptor descriptor{};
  Rgb colour;
  int found = 1, visible = 1;             // frames that matched it, frames that should have
  std::vector<Observation> observations;  // by increasing keyframe id
};

struct Covisible {
  KeyframeId keyframe = kNoKeyframe;
  int shared_points = 0;
};

// 0 where `id` is not among them.
inline int points_shared_with(KeyframeId id, const std::vector<Covisible>& covisible) {
  for (const Covisible& c : covisible)
    if (c.keyframe == id) return c.shared_points;
  return 0;
}

struct Keyframe {
  KeyframeId id = kNoKeyframe;
  FrameIndex frame = 0;
  double timestamp = 0;                          // [s]
  std::shared_ptr<const RgbdFeatures> features;  // immutable; empty once culled
  Rigid3 cam_from_world;
  // Of its pose in the world of its map's first keyframe: right perturbation of world_from_cam, [translation m,
  // rotation rad]. Map files leave it out: who loads a map takes it for the truth.
  Matrix6d covariance = Matrix6d::Zero();
  std::vector<PointId> points;       // per feature; kNoPoint where it shows none
  std::vector<Covisible> covisible;  // by decreasing shared_points, then increasing id
  KeyframeId parent = kNoKeyframe;   // spanning tree; the first keyframe has none
  // Kept by the map, increasing: live keyframes that hang on it, and those whose motion is told since it.
  std::vector<KeyframeId> children, followers;
  Rigid3 cam_from_parent;  // frozen when culled: the pose then follows the parent
  bool culled = false;
  // Since the live keyframe made just before it; null where nothing tells of it.
  std::shared_ptr<const KeyframeMotion> motion;
  // The flat surfaces that it sees, and the planes they are; null and empty where nobody looked.
  std::shared_ptr<const PlaneView> planes;
  std::vector<PlaneId> plane_of_patch;
};

// A point that is no more.
struct RemovedPoint {
  PointId id = kNoPoint;
  PointId replaced_by = kNoPoint;  // the point that it was fused into, which may itself be gone by now
  bool operator==(const RemovedPoint&) const = default;
};

// Keyframes, map points and who sees what. A value with structural sharing: a copy shares all that neither side has
// changed since (copy on write per keyframe and per block of points), so a snapshot costs what changed.
//
// One owner writes; everybody else reads snapshots. Nothing here locks.
class Map {
 public:
  // Immutable view of the map as it is now. Later writes copy what they touch.
  std::shared_ptr<const Map> snapshot() const;

  // A map from its parts, as a map file holds them: keyframes 0, 1, ... with their points and covisibility; live and
  // removed points by increasing id. Observations are made from the keyframes' points. Throws InputError saying which
  // part contradicts which, when the parts could not be those of a map.
  static Map restore(std::vector<Keyframe> keyframes, std::vector<MapPoint> points, std::vector<RemovedPoint> removed);

  // --- reading. Ids that are unknown, or point to what was removed, give null.
  KeyframeId keyframe_count() const { return static_cast<KeyframeId>(keyframes_.size()); }  // culled ones included
  const Keyframe* keyframe(KeyframeId id) const;                                            // also culled ones
  const Keyframe* live_keyframe(KeyframeId id) const;
  const MapPoint* point(PointId id) const;
  // Follows fusions to the point that survives; kNoPoint when it was removed.
  PointId resolve(PointId id) const;
  // Pose of any keyframe ever made; culled ones ride on their parents.
  Rigid3 cam_from_world(KeyframeId id) const;
  // The keyframe itself while it lives, else the living one that it rides on.
  struct Ancestor {
    KeyframeId id = kNoKeyframe;
    Rigid3 cam_from_ancestor;
  };
  Ancestor live_ancestor(KeyframeId id) const;
  std::vector<KeyframeId> live_keyframes() const;    // increasing
  std::vector<PointId> live_points() const;          // increasing
  std::vector<RemovedPoint> removed_points() const;  // by increasing id
  // The plane that stands for this one since planes turned out to be the same; must exist.
  PlaneId plane(PlaneId id) const;
  // The keyframe at the top of the spanning tree: keyframes of one map have one root, which has no parent.
  KeyframeId root(KeyframeId id) const;  // must exist
  // Of all keyframes ever made: whoever asks for many walks no path twice.
  std::vector<KeyframeId> root_of_each() const;
  std::vector<int> map_of_each() const;                            // likewise: the number of the map that it is in
  const std::vector<KeyframeId>& roots() const { return roots_; }  // of the maps that are not joined, increasing
  // The live keyframes of each map that is not joined, by its number and then increasing; one empty list of no map.
  std::vector<std::vector<KeyframeId>> keyframes_by_map() const;
  // Of the keyframes that share points with this one, which must exist, those that share most; `most` at most.
  std::vector<KeyframeId> best_covisible(KeyframeId id, size_t most) const;
  // The newest live keyframes of the map that `id` is in, `most` at most, increasing. None of an unknown one.
  std::vector<KeyframeId> newest_beside(KeyframeId id, int most) const;
  // The keyframes that see these points, by decreasing number of them, then increasing id. Points that are unknown are
  // seen by none.
  std::vector<Covisible> observers_of(const std::vector<PointId>& points) const;
  // The points that these keyframes show, which must exist: increasing, each once.
  std::vector<PointId> points_of(const std::vector<KeyframeId>& keyframes) const;
  // The live keyframes that look most like `descriptors`, best first; see PlaceIndex.
  std::vector<PlaceMatch> similar_keyframes(std::span<const Descriptor> descriptors, size_t max_results) const {
    return places_.query(descriptors, max_results);
  }
  size_t point_count() const { return point_count_; }
  int live_keyframe_count() const { return live_keyframe_count_; }

  // --- writing
  void add_keyframe(Keyframe keyframe);  // its id must be keyframe_count(); its points' observations are added too
  void add_point(MapPoint point);        // named by birth; observations must be empty, see observe()
  void observe(PointId point, KeyframeId keyframe, int feature);
  void forget(PointId point, KeyframeId keyframe);  // a point left with no observation is removed
  void remove_point(PointId point) { remove_point(point, kNoPoint); }
  void fuse(PointId from, PointId into);  // observations move; `from` forwards to `into`
  PlaneId add_plane();
  void join_planes(PlaneId a, PlaneId b);                                // the older one stands for both from now on
  void name_planes(KeyframeId id, std::vector<PlaneId> plane_of_patch);  // of the keyframe's flat surfaces
  void set_pose(KeyframeId id, const Rigid3& cam_from_world) { edit(id).cam_from_world = cam_from_world; }
  void set_covariance(KeyframeId id, const Matrix6d& covariance) { edit(id).covariance = covariance; }
  MapPoint& edit_point(PointId id);  // must exist
  // Recomputes the covisibility of `id` and mirrors the edges in its neighbours.
  void update_covisibility(KeyframeId id, int min_shared_points);
  // Removes a keyframe's observations; it and its children hang on its parent from now on.
  void cull_keyframe(KeyframeId id);
  // Moves the frames of all keyframes to before 0, the newest to -1: a session that begins counts its own from 0.
  void date_back();
  // Adds `other` as a map of its own, not joined to this one: its keyframes follow those that are there, and its points
  // and frames are named after them. Throws InputError when that is more than one map can hold.
  void append(const Map& other);
  // Hangs `id` on `parent`, or on the nearest ancestor of it that is live. Throws std::logic_error when `parent` hangs
  // on `id` itself.
  void set_parent(KeyframeId id, KeyframeId parent);

 private:
  // The points born at one keyframe. What is gone is told by the point that it was fused into, if any, and takes 6
  // bytes: most points that are ever made do not last.
  struct PointBlock {
    static constexpr int16_t kNever = INT16_MIN;
    std::vector<int16_t> place_of_feature;  // in `live`; ~place in `replaced_by` when it is gone; else kNever
    std::vector<MapPoint> live;             // in no order
    std::vector<PointId> replaced_by;       // of those that are gone; kNoPoint: by none
  };
  // Shared while its epoch is older than the map's, ours to write when equal.
  template <class T>
  struct Shared {
    std::shared_ptr<T> value;
    uint64_t epoch = 0;
  };

  Keyframe& edit(KeyframeId id);
  PointBlock& edit_block(KeyframeId birth);
  struct Slot {  // one of the two, or neither
    const MapPoint* live = nullptr;
    const PointId* replaced_by = nullptr;
    explicit operator bool() const { return live != nullptr || replaced_by != nullptr; }
  };
  Slot slot(PointId id) const;
  int16_t& place_of(PointId id);
  void add_live(MapPoint point);
  void add_gone(RemovedPoint point);
  void remove_point(PointId point, PointId replaced_by);
  void hang(KeyframeId id, KeyframeId parent);
  void tell_motion(KeyframeId id, std::shared_ptr<const KeyframeMotion> motion);
  void enter_tree(KeyframeId id);
  void hand_on_motion(KeyframeId id, KeyframeId parent, const Rigid3& cam_from_parent);
  void check_keyframes() const;
  void check_forwarding() const;

  CopyEpoch epoch_;
  std::vector<Shared<Keyframe>> keyframes_;
  std::vector<Shared<PointBlock>> blocks_;  // by birth keyframe
  std::vector<PlaneId> joined_to_;          // per plane; itself where it stands for itself
  PlaceIndex places_;                       // of the live keyframes
  std::vector<KeyframeId> roots_;           // increasing
  size_t point_count_ = 0;
  int live_keyframe_count_ = 0;
};

using MapView = std::shared_ptr<const Map>;

// Maps that are not joined are numbered by the age of their roots, from 0. A root that is not among these is newer than
// all.
inline int map_number(const std::vector<KeyframeId>& roots, KeyframeId root) {
  return static_cast<int>(std::lower_bound(roots.begin(), roots.end(), root) - roots.begin());
}

}  // namespace dkb
