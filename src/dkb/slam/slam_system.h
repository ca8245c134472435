// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/dynamics/mover.h"
#include "dkb/geometry/camera.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/map/map.h"
#include "dkb/slam/dynamic_stage.h"
#include "dkb/slam/options.h"
#include "dkb/util/timing.h"

namespace dkb {

// What became of one frame.
struct FrameResult {
  FrameIndex frame = 0;
  double timestamp = 0;  // [s]
  TrackingState state = TrackingState::initialising;
  // Camera axes: x right, y down, z forward. Valid when tracking or relocalised.
  Rigid3 world_from_cam;   // world: the first tracked camera (or the robot's base there, see base_from_cam)
  Rigid3 odom_from_cam;    // smooth: never jumps when the map is corrected; steer by this
  Rigid3 world_from_odom;  // takes the jumps; world_from_cam = world_from_odom * odom_from_cam
  Matrix6d covariance = Matrix6d::Zero();  // of the right perturbation of world_from_cam, [m, rad], camera axes
  int inliers = 0;                         // map points that the pose rests on
  KeyframeId reference = kNoKeyframe;      // keyframe that shows most of them
  bool keyframe = false;                   // the frame became a keyframe
  std::string keyframe_explanation;        // why, or why not; empty unless explain_keyframes(true)
  std::vector<Mover> movers;               // obstacles that move by themselves, seen in this frame
  std::vector<LateMask> late_masks;        // where movers were in earlier keyframes, as detections have shown since
  double tracking_ms = 0, wait_ms = 0;     // steady clock: own work, waiting for mapping

  bool tracked() const { return state == TrackingState::tracking || state == TrackingState::relocalised; }
};

enum class FeatureState : uint8_t { unused, used, outlier, dynamic };
const char* name_of(FeatureState state);

// What became of one feature that a frame extracted.
struct FeatureReport {
  float image_x = 0, image_y = 0;  // [px] of the image as read
  FeatureState state = FeatureState::unused;
};

// A frame of the finished trajectory.
struct TrajectoryFrame {
  FrameIndex frame = 0;  // below 0: a keyframe of the map that was loaded
  double timestamp = 0;
  Rigid3 world_from_cam;
  int map = 0;  // 0 = the first map; maps that were never joined have worlds of their own
};

struct SlamStatistics {
  int frames = 0, tracked = 0, lost = 0, relocalisations = 0;
  int keyframes = 0, keyframes_inserted = 0;
  int maps = 0;  // that are not joined
  int loops = 0, merges = 0;
  size_t map_points = 0;
  MappingReport mapping;
  std::map<std::string, int> keyframe_rules;  // keyframes by the rule that made them
  KeyframeTestCounts keyframe_tests;
  long features_removed = 0;  // features that the filter kept from tracking
  std::string detector = "none";
  double detector_rate_hz = 0;
  int detector_latency_frames = 0;
  std::map<std::string, StageSummary> stages;
};

// RGB-D SLAM: frames in, one by one, poses out. Several systems may live in one process; each is used from one thread.
// Deterministic: the same frames and options give the same poses and map to the last bit, with or without threads
// (except with pipeline.realtime).
class SlamSystem {
 public:
  // Throws InvalidOption.
  explicit SlamSystem(const CameraModel& camera, const SlamOptions& options = {}, DetectorSet detectors = {});
  ~SlamSystem();
  SlamSystem(const SlamSystem&) = delete;
  SlamSystem& operator=(const SlamSystem&) = delete;

  // Tracks the next frame. Throws InputError when its size is not the camera's or its stamp does not rise.
  FrameResult process(std::shared_ptr<const RgbdImage> image);
  // The same for callers with raw buffers: copies them. `colour` is 8-bit RGB (3 bytes per pixel) or grey (1); `depth`
  // in units of 1 / camera.depth_factor metres, 0 = no data. Rows are packed.
  FrameResult process(double timestamp, const uint8_t* colour, int channels, const uint16_t* depth);

  // A warning that a person should see, once each: the detector failed and the run goes on without it.
  std::optional<std::string> take_warning();

  // Waits for all outstanding mapping and takes its result. process() may go on afterwards.
  void finish();
  // Forgets everything but what the detector has in hand; the next frame starts a new world.
  void reset();
  // Forgets everything likewise and goes on in `map`, taken by the same camera and pyramid, wherever in it the camera
  // may be: frames are lost until one is found in it. Poses are in the map's world. Keyframes of `map` get frames
  // before 0.
  void load(Map map);
  // While localise-only, the map is not changed: no keyframes are made, no new map is started, and what tracking learns
  // of points (sightings, retractions) stays with it.
  void set_localise_only(bool on);
  // Every frame's result then says which of the keyframe tests said what, with their numbers.
  void explain_keyframes(bool on);

  // Poses of all tracked frames by the map as it is now; complete after finish(). Frames of a map that was not joined
  // with the first (yet) are in a world of their own.
  std::vector<TrajectoryFrame> trajectory() const;
  // The same frames as they were published.
  std::vector<TrajectoryFrame> online_trajectory() const;
  // Keyframes of the map, by id.
  std::vector<TrajectoryFrame> keyframes() const;
  MapView map() const;
  // All features of the last frame, those on movers included.
  const std::vector<FeatureReport>& features() const;
  // Where movers are in the last image.
  const MoverMask& mover_mask() const;
  const std::vector<Detection>& detections() const;
  SlamStatistics statistics() const;  // stages of other threads are complete after finish()
  const CameraModel& camera() const;
  const SlamOptions& options() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dkb
