// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/detection_stage.h"

#include <cmath>
#include <utility>

#include "dkb/detection/detection.h"
#include "dkb/util/thrown.h"

namespace dkb {
namespace {

constexpr double kFirstAnswer = 10;  // [s] that a real-time run waits for the first answer: it may have to load a model

bool finite(const Box& b) {
  return std::isfinite(b.x) && std::isfinite(b.y) && std::isfinite(b.w) && std::isfinite(b.h);
}

}  // namespace

std::string make_fit(Detections& detections, int width, int height) {
  std::string wrong;
  std::erase_if(detections.boxes, [&](Detection& d) {
    const Box inside = finite(d.box) ? clip(d.box, width, height) : Box{};
    if (!(inside.w > 0 && inside.h > 0)) {
      wrong = "a box lies outside the image; it is left out";
      return true;
    }
    d.box = inside;
    return false;
  });
  if (!detections.mask.empty() && (detections.mask.width() != width || detections.mask.height() != height)) {
    wrong = "a mask is of " + std::to_string(detections.mask.width()) + " x " +
            std::to_string(detections.mask.height()) + " px, the images of " + std::to_string(width) + " x " +
            std::to_string(height) + "; it is left out";
    detections.mask = {};
  }
  return wrong;
}

DetectionStage::DetectionStage(Detector& detector, const Camera& camera, const DetectionSchedule& schedule,
                               bool threaded, bool realtime)
    : detector_(detector),
      width_(camera.width),
      height_(camera.height),
      schedule_(schedule),
      realtime_(realtime),
      stage_([this](const Task& task) { return detect(task); },
             {.name = "the detector", .threaded = threaded, .priority = ThreadPriority::background}) {}

DetectionStage::Answer DetectionStage::detect(const Task& task) {
  const Stopwatch watch;
  Answer answer{{task.index, task.frame.stamp_ns(), {}}, threw_, nullptr, "", 0};
  if (threw_) return answer;
  const auto give_up = [&] {
    answer.failed = threw_ = true;
    answer.warning = "the detector failed: " + what_was_thrown() + "; it is not asked again";
  };
  try {
    answer.due.detections = detector_.detect(detector_input(task.frame));
    const std::string wrong = make_fit(answer.due.detections, width_, height_);
    if (!wrong.empty()) answer.warning = "the detector: " + wrong;
  } catch (const NeverStarted&) {
    answer.never_started = std::current_exception();
    give_up();
  } catch (...) {
    give_up();
  }
  answer.ms = watch.ms();
  return answer;
}

void DetectionStage::offer(FrameIndex index, const Frame& frame) {
  if (index < next_) return;
  const bool first = next_ == 0;
  if (rests_ && !first && (stage_.outstanding() > 0 || index < rest_until_)) return;
  next_ = index + schedule_.every;
  if (realtime_ && !first) stage_.drop_waiting();  // only the newest image is worth waiting
  stage_.push({index, frame}, first ? index : index + schedule_.latency);
}

std::optional<DetectionStage::Answer> DetectionStage::take(FrameIndex index) {
  if (!realtime_) return stage_.take_due(index, true);
  if (answered_) return stage_.take_due(index, false);
  auto answer = stage_.take_due_within(index, kFirstAnswer);
  if (!answer && stage_.outstanding() > 0)
    warnings_.push_back("the detector gave no first answer in time; tracking goes on without it until it does");
  answered_ = true;
  return answer;
}

std::vector<DueDetections> DetectionStage::take_due(FrameIndex index) {
  std::vector<DueDetections> due;
  const Stopwatch watch;
  const bool waits = stage_.must_wait(index), first = !answered_;
  while (auto answer = take(index)) {
    answered_ = true;
    if (first && answer->never_started) std::rethrow_exception(answer->never_started);
    if (!answer->warning.empty()) warnings_.push_back(std::move(answer->warning));
    failed_ = answer->failed;
    if (!answer->failed) {
      times_.add("detection", answer->ms);
      if (answers_++ == 0) first_stamp_ = answer->due.stamp_ns;
      last_stamp_ = answer->due.stamp_ns;
    }
    rest_until_ = index + (index - answer->due.frame);
    due.push_back(std::move(answer->due));
  }
  if (waits) times_.add("wait_detector", watch.ms());
  return due;
}

std::vector<std::string> DetectionStage::take_warnings() {
  return std::exchange(warnings_, {});
}

double DetectionStage::rate_hz() const {
  if (answers_ < 2 || last_stamp_ <= first_stamp_) return 0;
  return 1e9 * static_cast<double>(answers_ - 1) / static_cast<double>(last_stamp_ - first_stamp_);
}

}  // namespace dkb
