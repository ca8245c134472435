// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "dkb/map/map.h"

namespace dkb {

// The map as tracking knows it: the newest view of mapping's, and the keyframes made since. A value: copies share the
// view.
class TrackingMap {
 public:
  TrackingMap() : view_(std::make_shared<const Map>()) {}

  const Map& view() const { return *view_; }
  const MapView& shared_view() const { return view_; }
  // Keyframes that are in the newer view are not pending any more.
  void take_view(MapView view);
  // A keyframe that mapping was just told of; without a reference `cam_from_reference` is its cam_from_world.
  // `covariance`: how a map that begins with it hangs on its reference, as TrackedFrame's; of others zero, since the
  // frames that follow rest on the same points as they do.
  void add_pending(KeyframeId id, KeyframeId reference, const Rigid3& cam_from_reference, const Matrix6d& covariance);

  // Of a keyframe that is not in the view. Throws std::logic_error for one that was never made.
  const Rigid3& world_from_pending(KeyframeId id) const { return pending(id).world_from_cam; }
  // Pose of a keyframe. Throws std::logic_error for one that was never made.
  Rigid3 cam_from_world(KeyframeId id) const;
  // Of the map where this keyframe is: left perturbation of world_from_cam, [translation m, rotation rad]. For one that
  // is pending, that of the newest in the view which it hangs on, and how.
  Matrix6d covariance(KeyframeId id) const;
  // The first keyframe of the map that a keyframe belongs to, likewise.
  KeyframeId root(KeyframeId id) const;

 private:
  struct Pending {
    KeyframeId id = kNoKeyframe, reference = kNoKeyframe;
    Rigid3 cam_from_reference;
    Matrix6d covariance;
    Rigid3 world_from_cam;  // by the view
  };
  Rigid3 placed(const Pending& p) const;
  const Pending& pending(KeyframeId id) const;

  MapView view_;
  std::vector<Pending> pending_;  // by id
};

}  // namespace dkb
