// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/scene_stage.h"

#include <algorithm>
#include <utility>

#include "dkb/detection/mask_folder.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/features/optical_flow.h"

namespace dkb {
SceneStage::SceneStage(const Camera& camera, const SensorNoise& noise, const DynamicsOptions& options,
                       const Detectors& detectors, bool threaded, bool realtime)
    : camera_(camera),
      noise_(noise),
      options_(options),
      schedule_(detectors.schedule),
      prompt_(detectors.prompt),
      prompt_failures_(detectors.prompt.size()),
      slow_(detectors.slow),
      inference_(detectors.inference),
      objects_(camera, noise) {
  if (options_.filter == FilterKind::none) return;
  if (options_.filter != FilterKind::standard) rival_.emplace(options_.filter, camera, options_.paper);
  segments_motion_ = segments_motion_asked_ = detectors.motion;
  // The default filter asks the segmentation also beside other detectors: it knows what of a box is old background.
  const bool supports = !rival_ && (slow_ != nullptr || !prompt_.empty());
  if (segments_motion_ || supports) {
    motion_.emplace(camera, noise, options_.motion);
    segmenting_.emplace(
        "motion segmentation", [this] { segmentation_ = segment_motion(segmentation_task_); }, threaded);
  }
  for (const auto& detector : prompt_) detector->reset();
  if (slow_ != nullptr || (rival_ && rival_->needs_pyramid()))
    carrying_.emplace(
        "carrying detections", [this] { carried_ = carry(carry_task_); }, threaded);
  if (slow_ == nullptr) return;
  slow_->reset();
  slow_stage_.emplace(*slow_, camera, schedule_, threaded, realtime);
}

std::vector<DueDetections> SceneStage::take_due(FrameIndex index, const Frame& frame) {
  if (!slow_stage_) return {};
  if (slow_stage_->answers_at_once()) slow_stage_->offer(index, frame);
  auto due = slow_stage_->take_due(index);
  for (std::string& warning : slow_stage_->take_warnings()) warnings_.push_back(std::move(warning));
  return due;
}

void SceneStage::ask_slow_detector(FrameIndex index, const Frame& frame) {
  if (slow_stage_) slow_stage_->offer(index, frame);
}

void SceneStage::learn(const FrameOutcome& outcome) {
  if (motion_) {
    motion_->take_second_motion(outcome.second_motion);
    motion_->correct_guesses(outcome.found_world_from_guessed);
    motion_->commit(outcome.cam_from_world, outcome.guessed);
  }
  if (outcome.keyframe && !past_.empty()) {
    past_.back().keyframe = true;
    if (motion_) past_.back().still = motion_->still();
  }
}

// `boxes` grows by all that were found, `unmasked` by those whose detector gave no mask with them.
MoverMask SceneStage::ask_prompt_detectors(const Frame& frame, std::vector<Detection>& boxes,
                                           std::vector<Detection>& unmasked) {
  MoverMask given;
  for (size_t i = 0; i < prompt_.size(); ++i) {
    std::string warning;
    Detections found = asked(*prompt_[i], frame, camera_.width, camera_.height, prompt_failures_[i], warning);
    if (!warning.empty()) warnings_.push_back("detector " + prompt_[i]->kind() + warning);
    boxes.insert(boxes.end(), found.boxes.begin(), found.boxes.end());
    if (found.mask.empty())
      unmasked.insert(unmasked.end(), found.boxes.begin(), found.boxes.end());
    else
      unite(given, {1, std::move(found.mask)}, camera_.width, camera_.height);
  }
  return given;
}

Segmentation SceneStage::segment_motion(const SegmentationTask& task) {
  const Stopwatch watch;
  Segmentation made;
  motion_->observe(*task.frame.image(), task.depth_time, task.cam_from_world_expected, task.step_covariance);
  if (segments_motion_) made.mask = motion_->mask();
  made.ms = watch.ms();
  return made;
}

Carried SceneStage::carry(const CarryTask& task) {
  const Stopwatch watch;
  const RgbdImage& image = *task.frame.image();
  Carried made;
  auto pyramid = std::make_shared<ImagePyramid>(flow_pyramid());
  pyramid->build(image.grey);
  const auto receive = [&](bool of_this_frame) {
    for (const DueDetections& d : task.due) {
      if ((d.frame == task.index) != of_this_frame) continue;
      auto late = objects_.receive(d.frame, d.detections, past_);
      if (!rival_) std::move(late.begin(), late.end(), std::back_inserter(made.late_masks));
    }
  };
  receive(false);
  if (slow_stage_) objects_.follow(past_, *pyramid);
  receive(true);
  if (!rival_) made.silhouettes = silhouettes(image.depth, objects_.unmasked_boxes(), camera_, noise_);
  made.mask = objects_.mover_mask();
  made.pyramid = std::move(pyramid);
  made.ms = watch.ms();
  return made;
}

void SceneStage::begin(FrameIndex index, const Frame& frame, std::vector<DueDetections> due,
                       const Expectation& expected) {
  // What is left of a frame that failed in between belongs to nobody.
  for (auto* task : {&segmenting_, &carrying_})
    if (*task) (*task)->drop();
  // Motion, which only supported the detectors, stands in for one that fails.
  segments_motion_ = segments_motion_asked_ || (!rival_ && detector_failing());
  if (segmenting_) {
    const Matrix6d covariance = expected.step ? expected.step->covariance : Matrix6d::Identity();
    segmentation_task_ = {frame, expected.depth_time, expected.cam_from_world, covariance};
    segmenting_->begin();
  }
  if (carrying_) {
    carry_task_ = {frame, index, std::move(due)};
    carrying_->begin();
  }
}

MoverMask SceneStage::take_motion(std::vector<Detection>& boxes) {
  if (!segmenting_) return {};
  const Stopwatch watch;
  segmenting_->finish();
  segmentation_task_.frame = {};
  times_.add("motion", watch.ms());
  times_.add("segmentation", segmentation_.ms);
  MoverMask moving = std::move(segmentation_.mask);
  if (rival_)  // the rivals know boxes only
    for (Detection& d : mover_boxes(moving.cells, 4 * 4, moving.cell)) boxes.push_back(std::move(d));
  return moving;
}

void SceneStage::remember(const ExtractedFrame& frame, std::shared_ptr<const ImagePyramid> pyramid) {
  PastFrame now{frame.index, frame.frame.image(), std::move(pyramid), {}, {}, false};
  for (const Corner& c : frame.orb.corners) now.corners.emplace_back(c.x, c.y);
  past_.push_back(std::move(now));
  const size_t kept = slow_stage_ ? static_cast<size_t>(memory()) + 1 : 1;
  while (past_.size() > kept) past_.pop_front();
}

Scene SceneStage::look(ExtractedFrame frame, const UndistortionTable& undistort, const Expectation& expected) {
  Scene scene;
  scene.rejected.assign(frame.orb.corners.size(), FeatureReason::none);
  scene.extracted = std::move(frame);
  if (scene.extracted.frame.prior()) scene.step = expected.step;
  if (options_.filter == FilterKind::none) return scene;
  const RgbdImage& image = scene.extracted.image();

  Stopwatch watch;
  if (carrying_) {
    carrying_->finish();
    carry_task_ = {};
    times_.add("carrying", carried_.ms);
  }
  Carried carried = std::exchange(carried_, {});
  scene.late_masks = std::move(carried.late_masks);
  scene.boxes = objects_.boxes();
  std::vector<Detection> unmasked;
  MoverMask given = ask_prompt_detectors(scene.extracted.frame, scene.boxes, unmasked);
  MoverMask bodies = given;
  unite(bodies, {1, objects_.mask()}, camera_.width, camera_.height);
  unite(given, carried.mask, camera_.width, camera_.height);
  times_.add("flow", watch.ms());
  const MoverMask moving = take_motion(scene.boxes);
  if (motion_ && motion_->aligned_step()) scene.step = motion_->aligned_step();

  watch = Stopwatch();
  const auto& corners = scene.extracted.orb.corners;
  if (rival_) {
    const auto dynamic =
        rival_->dynamic({scene.extracted.orb, image, undistort, scene.boxes, past_.empty() ? nullptr : &past_.back(),
                         carried.pyramid.get(), expected.current_from_previous(), expected.keyframe_points_in_camera});
    for (size_t i = 0; i < corners.size(); ++i)
      if (dynamic[i]) scene.rejected[i] = FeatureReason::moved;
  } else {
    Silhouettes boxed = std::move(carried.silhouettes);
    const Silhouettes prompt = silhouettes(image.depth, unmasked, camera_, noise_);
    unite(boxed.mask, prompt.mask, camera_.width, camera_.height);
    unite(boxed.body, prompt.body, camera_.width, camera_.height);
    if (motion_) motion_->take_bodies(bodies);
    if (motion_ && !boxed.mask.empty()) {
      boxed = without_still(std::move(boxed), motion_->still());
      motion_->take_bodies(boxed.body);
    }
    scene.mask = std::move(boxed.mask);
    unite(scene.mask, given, camera_.width, camera_.height);
    if (segments_motion_) unite(scene.mask, moving, camera_.width, camera_.height);
    const CornerDepths depths(image.depth, camera_, noise_);
    for (size_t i = 0; i < corners.size(); ++i)
      if (is_on(scene.mask, {corners[i].x, corners[i].y}, depths)) scene.rejected[i] = FeatureReason::on_mover;
  }
  times_.add("filter", watch.ms());
  if (carried.pyramid) remember(scene.extracted, std::move(carried.pyramid));
  return scene;
}

bool SceneStage::detector_failing() const {
  return (slow_stage_ && slow_stage_->failing()) ||
         std::any_of(prompt_failures_.begin(), prompt_failures_.end(), [](const auto& f) { return f.failing(); });
}
bool SceneStage::detector_failed() const {
  return (slow_stage_ && slow_stage_->failed()) ||
         std::any_of(prompt_failures_.begin(), prompt_failures_.end(), [](const auto& f) { return f.given_up(); });
}

std::vector<std::string> SceneStage::take_warnings() {
  return std::exchange(warnings_, {});
}

std::string SceneStage::detector_kind() const {
  std::string kind = slow_ ? slow_->kind() : "";
  if (segments_motion_) kind += kind.empty() ? "motion" : "+motion";
  for (const auto& d : prompt_) kind += (kind.empty() ? "" : "+") + d->kind();
  return kind.empty() ? "none" : kind;
}

StageTimes SceneStage::take_times() {
  if (slow_stage_) times_.merge(slow_stage_->take_times());
  return times_.take();
}

}  // namespace dkb
