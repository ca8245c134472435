// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "dkb/dynamics/match_motion.h"
#include "dkb/features/frame_features.h"
#include "dkb/features/image_appearance.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/map/ids.h"
#include "dkb/solver/pose_optimiser.h"
#include "dkb_slam/frame.h"

namespace dkb {

// Along it a feature was seen. The direction is in front of the camera at a depth of 1.
struct SightRay {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero(), direction = Eigen::Vector3d::UnitZ();  // [m]
  double variance = 0;  // [px^2] of the corner, and of the pose that it was seen from
};

// A visual-odometry point that a feature shows (see OdometryPoints).
struct OdometryMatch {
  Eigen::Vector3d point_in_world;  // [m]
  bool guessed = false;            // at the depth of its surroundings
  SightRay first = {};             // of a guessed one: how it was seen first, in the world
  bool moves = false;              // it has left that ray: it says nothing of the pose, but is followed on
};

// Where the camera is by what is not in the images.
struct PosePrediction {
  Rigid3 cam_from_world;
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation of world_from_cam, [m, rad], camera axes

  // It may weigh in a pose by the images: not where the map shows another place.
  bool weighs = false;
  // By something beside the camera, which may slip: it has no weight where the images do not allow it. Corners do not
  // overrule the camera's own depth so: they may be on somebody who walks.
  bool told = false;

  // Whether what the images say alone may be of the same pose.
  bool allows(const PosePrior& by_observations) const;
  // Whether a pose by the images may be the same one.
  bool agrees(const Rigid3& found_cam_from_world) const;
};

// What the frames after it need to know of one. The pose hangs on a keyframe, since the world may move under the
// tracker. All but index, stamp and state holds when tracking or relocalised; of a predicted frame the reference and
// the pose.
struct PosedFrame {
  FrameIndex index = 0;
  double timestamp = 0;  // [s]
  TrackingState state = TrackingState::initialising;
  bool starts_map = false;  // it wants to be a map's first keyframe
  std::shared_ptr<const RgbdFeatures> features;
  std::vector<PointId> points;  // per feature: the map point it shows (inliers of the pose), else kNoPoint
  std::vector<int> source;      // per feature: its index among the features that tracking was given
  KeyframeId reference = kNoKeyframe;
  Rigid3 cam_from_reference;
  Rigid3 seen_cam_from_cam;  // the camera that saw the features, from this one; identity unless it is predicted
  Rigid3 cam_from_world;     // by the map as tracking knew it at the time
  Matrix6d covariance = Matrix6d::Identity();  // right perturbation of world_from_cam, [m, rad], camera axes

  bool tracked() const { return state == TrackingState::tracking || state == TrackingState::relocalised; }
};

// A frame as tracking leaves it.
struct TrackedFrame : PosedFrame {
  // Of the frame before, which its map starts with: made again at the velocity that only this frame tells.
  std::shared_ptr<const RgbdFeatures> start_features;
  bool ambiguous = false;                   // lost: it shows a place of the map, or one that looks like it
  std::optional<PosePrediction> predicted;  // by the step from the frame before
  std::vector<FeatureMotion> motion;        // per feature
  // Per feature: the map point it matched, also where the pose rejects it, and where that is [m]; in tracking.
  std::vector<PointId> matched;
  std::vector<Eigen::Vector3d> matched_in_world;
  std::vector<uint8_t> outlier;                        // per feature: 1 = matched, but rejected by the robust pose
  std::vector<std::optional<OdometryMatch>> odometry;  // per feature: of inliers and movers that are no map points
  std::vector<PointId> in_view, found;                 // map points that should be seen by the pose, and those that are
  std::vector<MatchMotion> second_motion;              // of each match, where they surely show two motions; else empty
  std::vector<uint8_t> makes_point;          // per feature: 1 = it made a map point, when the frame became a keyframe
  std::optional<PosePrior> by_observations;  // the pose without what was predicted, where that was weighed
  int inliers = 0;                           // among `points`
  int with_depth = 0;                        // features with depth, those on movers left out
  int refused_inliers = 0;                   // of the best pose that was refused

  // None of its features shows anything.
  void show_nothing() {
    points.assign(features->size(), kNoPoint);
    outlier.assign(features->size(), 0);
    odometry.assign(features->size(), std::nullopt);
  }
  MatchableFeatures matchable() const { return {*features, motion}; }
};

// What tracking is given of a frame.
struct TrackingInput {
  FrameIndex index = 0;
  double timestamp = 0;  // [s]
  const FrameFeatures& features;
  PointAppearance* appearance =
      nullptr;                           // tells places that look alike apart when a lost camera is sought; may be null
  const MotionPrior* prior = nullptr;    // by something beside the camera; may be null
  const MotionPrior* step = nullptr;     // the same motion as the surfaces in view show it as well; may be null
  const FrameFeatures* start = nullptr;  // of the frame before, if a map starts with it
  bool movers = false;                   // are looked for: some of what the map holds as still may move
  bool may_start_map = true;             // else a frame that finds no map stays without a pose
};

}  // namespace dkb
