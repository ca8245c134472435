// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dkb/comparison/rival_filter.h"
#include "dkb/dynamics/carried_objects.h"
#include "dkb/dynamics/motion_segmenter.h"
#include "dkb/slam/detection_stage.h"
#include "dkb/slam/scene.h"
#include "dkb/util/side_task.h"
#include "dkb/util/timing.h"

namespace dkb {

struct DynamicsOptions {
  FilterKind filter = FilterKind::standard;
  PaperFilterOptions paper;
  MotionOptions motion;
};

// What tracking knows before it looks at a frame.
struct Expectation {
  Rigid3 cam_from_world;
  double depth_time = 0;                                   // [s] when the colour camera saw what the depth image shows
  std::optional<MotionPrior> step;                         // since the frame before; nothing without one
  std::vector<Eigen::Vector3d> keyframe_points_in_camera;  // for `multiview`: points of earlier keyframes

  Rigid3 current_from_previous() const { return step ? step->previous_from_current.inverse() : Rigid3(); }
};

// Of one frame.
struct Segmentation {
  MoverMask mask;  // nothing when the segmentation only supports other detectors
  double ms = 0;
};
struct SegmentationTask {
  Frame frame;
  double depth_time;
  Rigid3 cam_from_world_expected;
  Matrix6d step_covariance;
};

// Where the slow detector's objects are in one frame.
struct Carried {
  std::shared_ptr<const ImagePyramid> pyramid;  // of the image
  std::vector<LateMask> late_masks;
  Silhouettes silhouettes;  // of boxes without a mask
  MoverMask mask;           // that the detector gave
  double ms = 0;
};
struct CarryTask {
  Frame frame;
  FrameIndex index = 0;
  std::vector<DueDetections> due;
};

// What became of a frame: what the stage learns by it.
struct FrameOutcome {
  std::optional<Rigid3> cam_from_world;  // nothing when lost
  bool guessed = false;                  // the pose is a prediction
  Rigid3 found_world_from_guessed;       // what the guesses before it were off by, where the images tell the pose again
  bool keyframe = false;
  std::span<const MatchMotion> second_motion;  // of the matches, where they show two
};

// Says what of a frame moves (DKB section 3.1): detections made beside tracking are carried to the frame by flow,
// prompt detectors are asked, depth is held against earlier views, and the chosen filter rejects corners.
// Deterministic.
class SceneStage {
 public:
  // `threaded`, `realtime`: of the slow detector.
  SceneStage(const Camera& camera, const SensorNoise& noise, const DynamicsOptions& options, const Detectors& detectors,
             bool threaded, bool realtime);

  // What the slow detector has due at this frame. It may wait.
  std::vector<DueDetections> take_due(FrameIndex index, const Frame& frame);
  // Gives the slow detector this frame, if it was not given it by take_due.
  void ask_slow_detector(FrameIndex index, const Frame& frame);
  // While on, the slow detector of a real-time run rests half of the time.
  void rest_detector(bool on) {
    if (slow_stage_) slow_stage_->rest(on);
  }
  // Motion segmentation and flow need no corners: they start, each on a thread of its own, while these are extracted.
  void begin(FrameIndex index, const Frame& frame, std::vector<DueDetections> due, const Expectation& expected);
  // Of the frame that was begun.
  Scene look(ExtractedFrame frame, const UndistortionTable& undistort, const Expectation& expected);
  // After that: what became of the frame.
  void learn(const FrameOutcome& outcome);
  // Not between begin() and look(): later poses are given in the new world.
  void move_world(const Rigid3& new_from_old) {
    if (motion_) motion_->move_world(new_from_old);
  }
  // How the camera came to where it is now is not known: what earlier views saw cannot be put beside it.
  void forget_views() {
    if (motion_) motion_->forget_views();
  }

  // Depth is held against earlier depth in each frame, whatever detects movers.
  bool compares_depth() const { return motion_.has_value(); }
  int keyframes_looked_at() const { return rival_ ? rival_->keyframes_looked_at() : 0; }
  // [frames] after which no late mask of a keyframe can come any more.
  int memory() const { return schedule_.latency + schedule_.every; }

  std::vector<std::string> take_warnings();
  std::string detector_kind() const;
  double detector_rate_hz() const { return slow_stage_ ? slow_stage_->rate_hz() : 0; }
  int detector_latency() const { return slow_stage_ ? schedule_.latency : 0; }
  bool detector_failed() const;  // one of them: it is not asked any more
  std::string detector_inference() const { return slow_stage_ ? inference_ : std::string(); }
  // Durations since they were taken last. Parts of tracking: flow and motion (what it waits for carrying and for the
  // segmentation, and what it does of them itself), filter. Beside it: carrying, segmentation, and those of the
  // detector.
  StageTimes take_times();

 private:
  bool detector_failing() const;  // one of them: nothing is known of its last image
  MoverMask ask_prompt_detectors(const Frame& frame, std::vector<Detection>& boxes, std::vector<Detection>& unmasked);
  Segmentation segment_motion(const SegmentationTask& task);
  MoverMask take_motion(std::vector<Detection>& boxes);
  Carried carry(const CarryTask& task);
  void remember(const ExtractedFrame& frame, std::shared_ptr<const ImagePyramid> pyramid);

  Camera camera_;
  SensorNoise noise_;
  DynamicsOptions options_;
  DetectionSchedule schedule_;
  std::vector<std::shared_ptr<Detector>> prompt_;
  std::vector<DetectorFailures> prompt_failures_;  // one each
  std::shared_ptr<Detector> slow_;
  std::string inference_;  // of the slow detector's network
  std::optional<DetectionStage> slow_stage_;
  std::optional<RivalFilter> rival_;
  std::optional<MotionSegmenter> motion_;
  bool segments_motion_ = false, segments_motion_asked_ = false;  // as a detector of its own; whether a user wants that
  CarriedObjects objects_;                                        // of the slow detector
  PastFrames past_;                                               // as many as the slow detector's latency needs
  std::vector<std::string> warnings_;
  StageTimes times_;
  SegmentationTask segmentation_task_;  // these two belong to segmenting_ while it is at work
  Segmentation segmentation_;
  CarryTask carry_task_;  // these two, objects_ and past_ belong to carrying_ likewise
  Carried carried_;
  std::optional<SideTask> segmenting_, carrying_;  // last: their threads end first
};

}  // namespace dkb
