// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/map/ids.h"

namespace dkb {

// A visual-odometry point that a feature shows (see OdometryPoints).
struct OdometryMatch {
  Eigen::Vector3d point_in_world;  // [m]
  bool guessed = false;            // at the depth of its surroundings
};

// A frame with its pose, as tracking leaves it. The pose hangs on a keyframe, since the world may move under the
// tracker.
struct TrackedFrame {
  FrameIndex index = 0;
  double timestamp = 0;  // [s]
  std::shared_ptr<const RgbdFeatures> features;
  std::vector<PointId> points;   // per feature: the map point it shows (inliers of the pose), else kNoPoint
  std::vector<uint8_t> outlier;  // per feature: 1 = matched, but rejected by the robust pose
  std::vector<std::optional<OdometryMatch>> odometry;  // per feature: inliers of the pose that are no map points
  std::vector<int> source;  // per feature: its index among the features that tracking was given
  KeyframeId reference = kNoKeyframe;
  Rigid3 cam_from_reference;
  Rigid3 cam_from_world;                       // by the map as tracking knew it at the time
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation of world_from_cam, [m, rad], camera axes
  int inliers = 0;                             // among `points`
};

}  // namespace dkb
