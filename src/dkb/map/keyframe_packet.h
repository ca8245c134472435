// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "dkb/features/plane_finder.h"
#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/map/ids.h"
#include "dkb/map/keyframe_motion.h"

namespace dkb {

// A point made from depth at a keyframe which mapping has not published yet.
struct ProvisionalPoint {
  PointId id = kNoPoint;              // tells the keyframe and its feature
  Eigen::Vector3d point_in_keyframe;  // [m] in that keyframe's camera
  float scale = 1;                    // pyramid scale of the feature
  Descriptor descriptor{};
};

// How often a map point was in view and was matched since the last report to mapping.
struct PointVisibility {
  PointId point = kNoPoint;
  int visible = 0, found = 0;
};

// What tracking tells mapping of a new keyframe; with no keyframe (id = kNoKeyframe) only of visibility and
// retractions.
struct KeyframePacket {
  KeyframeId id = kNoKeyframe;
  FrameIndex frame = 0;
  double timestamp = 0;
  std::shared_ptr<const RgbdFeatures> features;
  KeyframeId reference = kNoKeyframe;  // none for the first keyframe of a map
  Rigid3 cam_from_reference;           // cam_from_world for the first keyframe of a map
  std::shared_ptr<const KeyframeMotion> motion;
  std::shared_ptr<const PlaneView> planes;  // null: nobody looked
  std::vector<PointId> points;              // per feature
  std::vector<ProvisionalPoint> new_points;
  std::vector<PointVisibility> visibility;  // by increasing point id
  std::vector<PointId> retracted;           // points that turned out to move
};

}  // namespace dkb
