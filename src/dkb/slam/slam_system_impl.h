// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>

#include "dkb/features/patch_describer.h"
#include "dkb/slam/loop_stage.h"
#include "dkb/slam/mapping_stage.h"
#include "dkb/slam/readout_calibration.h"
#include "dkb/slam/slam_system.h"

namespace dkb {

// The stages of one system and what it knows between frames. Inside the room only.
class SlamSystem::Impl {
 public:
  Impl(const CameraModel& camera, const SlamOptions& options, DetectorSet detectors)
      : camera_(camera),
        options_(options),
        undistort_(camera),
        extractor_(options.features),
        describer_({.levels = options.features.levels, .scale = options.features.scale}),
        dynamics_(camera, options.dynamics, std::move(detectors)) {
    camera_.check();
    options_.check();
    start();
  }

  FrameResult process(std::shared_ptr<const RgbdImage> image);
  void finish();
  void start(Map map = {});

  CameraModel camera_;
  SlamOptions options_;
  UndistortionTable undistort_;
  OrbExtractor extractor_;
  PatchDescriber describer_;                // of places without a corner, when a lost camera is sought
  bool describer_is_set_ = false;           // to the frame at hand
  OrbFeatures orb_;                         // of the frame at hand
  std::shared_ptr<const RgbdImage> image_;  // likewise
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<KeyframePolicy> policy_;
  std::unique_ptr<MappingStage> mapping_;
  std::unique_ptr<LoopStage> loop_;
  DynamicStage dynamics_;
  DynamicScene scene_;  // of the last frame
  std::optional<PointEvidence> evidence_;
  std::optional<ReadoutCalibration> readout_;
  std::optional<MoverTracker> movers_;

  // A frame of the trajectory hangs on a keyframe, since the world may still move.
  struct Record {
    FrameIndex frame;
    double timestamp;
    KeyframeId reference;
    Rigid3 cam_from_reference;
    Rigid3 world_from_cam_online;
  };
  std::vector<Record> records_;
  FrameIndex next_frame_ = 0;
  FrameIndex lost_frames_ = 0;  // in a row
  double last_timestamp_ = 0;
  KeyframeId next_keyframe_ = 0;
  KeyframeId last_keyframe_ = kNoKeyframe;  // the newest one where the camera is
  FrameIndex last_keyframe_frame_ = 0, last_relocalisation_frame_ = -1000000;
  Rigid3 world_from_odom_, odom_from_cam_;
  bool localise_only_ = false;
  bool explain_keyframes_ = false;
  std::vector<size_t> kept_;                    // features given to tracking, as indices of all
  std::vector<uint8_t> by_mover_;               // of these, which hang together with a mover (Keypoint::by_mover)
  std::vector<uint8_t> suspect_;                // of these, which may move
  std::vector<FeatureReport> feature_reports_;  // all features of the last frame
  struct RecentKeyframe {
    FrameIndex frame;
    KeyframeId id;
    std::shared_ptr<const RgbdFeatures> features;
  };
  std::deque<RecentKeyframe> recent_keyframes_;  // whose detections may still be out
  SlamStatistics statistics_;
  StageTimes times_;

 private:
  void take_map(bool wait);
  void take_view(const MapView& view);
  void extract(const RgbdImage& image);
  void filter_dynamic(std::shared_ptr<const RgbdImage> image);
  // The table undoes the distortion at image pixels; its negative at the ideal pixel is near enough.
  Eigen::Vector2f image_pixel(const Eigen::Vector2d& ideal) const {
    return 2 * ideal.cast<float>() - undistort_(static_cast<float>(ideal.x()), static_cast<float>(ideal.y()));
  }
  // Index among all extracted features.
  size_t source_feature(const TrackedFrame& frame, size_t feature) const {
    return kept_[frame.source.empty() ? feature : static_cast<size_t>(frame.source[feature])];
  }
  void report_features(const TrackedFrame& frame);
  void weigh_evidence();
  std::vector<LateMask> retract_late();
  std::vector<Eigen::Vector3d> keyframe_points_in_camera(const Rigid3& cam_from_world) const;
  std::optional<bool> looks_the_same(const Eigen::Vector2d& pixel, double depth, int octave,
                                     const Descriptor& descriptor);
  KeyframeDecision decide(const TrackOutcome& outcome);
  void insert_keyframe(TrackedFrame& frame);
  void keep_odometry_smooth(const TrackOutcome& outcome);
};

}  // namespace dkb
