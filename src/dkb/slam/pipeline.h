// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/dense/dense_mapper.h"
#include "dkb/dynamics/point_evidence.h"
#include "dkb/features/orb_extractor.h"
#include "dkb/features/plane_finder.h"
#include "dkb/slam/frame_rate.h"
#include "dkb/slam/load_shedding.h"
#include "dkb/slam/loop_stage.h"
#include "dkb/slam/mapping_stage.h"
#include "dkb/slam/merge_hold.h"
#include "dkb/slam/mover_stage.h"
#include "dkb/slam/odometry_frame.h"
#include "dkb/slam/options.h"
#include "dkb/slam/prior_calibration.h"
#include "dkb/slam/repeated_depth.h"
#include "dkb/slam/run_record.h"
#include "dkb/slam/scene_stage.h"
#include "dkb/slam/stamp_doubt.h"
#include "dkb/slam/timing_calibration.h"
#include "dkb/tracking/tracker.h"

namespace dkb {

// What stands outside a world and lasts from one to the next.
struct PipelineContext {
  Camera camera;
  SlamOptions options;
  Detectors detectors;
  std::shared_ptr<KeyframePolicy> policy;  // of the user; may be null
};

// The stages of one world, from its first frame to its last: a new world gets a new pipeline. What a stage knows of
// earlier frames is its own; a frame itself is a value that every stage makes richer.
class Pipeline {
 public:
  // Goes on in `map`, whose keyframes are of frames below 0; an empty one is a new world. `context` and `record` must
  // outlive the pipeline.
  Pipeline(const PipelineContext& context, RunRecord& record, Map map);

  // Throws InputError for a frame that does not fit.
  void check(const Frame& frame) const;
  // A frame that fits. Throws InputError for what failed in a stage's thread: the pipeline is of no use after that.
  FrameResult process(const Frame& frame);
  // A frame that nobody looked at came in between.
  void pass_over() { stamp_doubt_.pass_over(); }
  // Waits for what mapping should have done by now, as a dataset run does at each frame anyway.
  void catch_up() {
    if (options_.pipeline.realtime) take_due_map(true);
  }
  // Waits for all outstanding work and takes its result.
  void finish();

  void localize_only(bool on) { localize_only_ = on; }
  void suggest_pose(const PosePrediction& pose) {
    tracker_.suggest(pose);
    scenes_.forget_views();
    odometry_.lost();  // how the camera came there is not known
  }
  void explain_keyframes(bool on) { explain_keyframes_ = on; }
  // From the keyframes so far: of the map of this number, without one of that of the last pose. Throws InputError when
  // dense mapping is off.
  std::function<DenseMap()> dense_map_task(std::optional<int> map = {}) const;

  std::vector<Event> take_events();

 private:
  // When what mapping is given now becomes visible.
  FrameIndex mapping_due() const { return next_frame_ + rate_.frames(options_.pipeline.mapper_latency); }
  void shed_load();
  bool late_for_features() const { return load_ && load_->level() >= LoadShedding::kFeatures; }
  void follow_motion(const Scene& scene);  // since the last keyframe
  double take_due_map(bool wait);
  void take_view(const MapView& view);
  void correct(std::vector<std::shared_ptr<const MapCorrection>> corrections, FrameIndex due);
  void apply(std::shared_ptr<const MapCorrection> correction, FrameIndex due);
  void weigh_merge(const TrackedFrame& tracked, PointAppearance& appearance);
  int features_wanted() const;
  ExtractedFrame extract(const Frame& frame);
  Expectation expect(const Frame& frame) const;
  void look_for_movers(const Scene& scene, const Expectation& expected);
  TrackedFrame track(const Scene& scene, const UsableFeatures& usable);
  void retract_late(const std::vector<LateMask>& masks);
  void weigh_evidence(const Scene& scene, const TrackedFrame& tracked);
  bool waits_for_depth(const TrackedFrame& tracked);
  KeyframeDecision decide(const Scene& scene, const TrackedFrame& tracked);
  std::shared_ptr<const PlaneView> find_planes(const Scene& scene);
  void insert_keyframe(const Scene& scene, const UsableFeatures& usable, TrackedFrame& tracked);
  void push_start(const TrackedFrame* next);
  int map_number(KeyframeId reference);
  bool may_make_keyframes() const { return !localize_only_ && next_keyframe_ <= kLastKeyframe; }
  void publish(const Scene& scene, const TrackedFrame& tracked, const KeyframeDecision& decision, FrameResult& result);
  void note(Event::Kind kind, std::string text = "", int keyframe = -1);
  void note_changes(const Scene& scene, const TrackedFrame& tracked);
  std::string remedy_without_features(const Scene& scene) const;
  void collect_times();

  const PipelineContext& context_;
  const SlamOptions& options_;
  RunRecord& record_;
  UndistortionTable undistort_;
  OrbExtractor extractor_;
  PlaneFinder planes_;
  Tracker tracker_;
  MergeHold merge_hold_;
  std::unique_ptr<KeyframeDecider> decider_;
  SceneStage scenes_;
  PointEvidence evidence_;
  TimingCalibration timing_;
  PriorCalibration priors_;
  MoverStage movers_;
  OdometryFrame odometry_;
  std::optional<DenseMapper> dense_;
  std::optional<LoadShedding> load_;  // of a real-time run

  // What the next frame needs of the one before.
  FrameRate rate_;
  StampDoubt stamp_doubt_;
  RepeatedDepth repeated_depth_;
  FrameIndex next_frame_ = 0;
  int64_t last_stamp_ns_ = 0;
  int frames_before_map_ = 0;
  int frames_without_map_ = 0;    // of those that only localise
  int frames_without_depth_ = 0;  // in a row
  bool told_no_depth_ = false;
  std::optional<double> last_depth_time_;  // [s] of the last tracked frame with depth
  size_t most_corners_ = 0;                // of a frame before there was a map
  double crowded_share_ = 0;               // of its features that movers took
  MoverMask last_mask_;
  // A map's first keyframe waits for the frame after it, which tells the velocity at which its features were seen.
  struct MapStart {
    Scene scene;
    UsableFeatures usable;
    KeyframePacket packet;
  };
  std::optional<MapStart> start_;
  TrackingState last_state_ = TrackingState::initialising;
  struct LastKeyframe {
    KeyframeId id = kNoKeyframe;  // the newest one where the camera is
    FrameIndex frame = 0;
    int64_t stamp_ns = 0;
  };
  static LastKeyframe last_keyframe_of(const Map& map, KeyframeId id);
  KeyframeId next_keyframe_ = 0;
  LastKeyframe last_keyframe_;
  // Looked up where the view or the reference changes.
  struct MapNumber {
    KeyframeId reference = kNoKeyframe;
    int number = 0;
  };
  MapNumber map_number_;
  std::optional<KeyframeMotion> since_keyframe_;  // nothing where a frame since then had no motion
  FrameIndex last_relocalisation_ = -1000000;
  struct RecentKeyframe {
    FrameIndex frame;
    KeyframeId id;
    std::shared_ptr<const RgbdFeatures> features;
  };
  std::deque<RecentKeyframe> recent_keyframes_;  // whose detections may still be out

  bool localize_only_ = false, explain_keyframes_ = false;
  std::vector<Event> events_;
  MappingStage mapping_;  // last: their threads end first
  LoopStage loop_;
};

}  // namespace dkb
