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

Misfit make_fit(Detections& detections, int width, int height) {
  const bool said_something = !detections.boxes.empty() || !detections.mask.empty();
  std::string wrong;
  std::erase_if(detections.boxes, [&](Detection& d) {
    const Box inside = finite(d.box) ? clip(d.box, width, height) : Box{};
    if (!(inside.w > 0 && inside.h > 0)) {
      wrong = "a box lies outside the image; give left, top, width and height in pixels of the image";
      return true;
    }
    d.box = inside;
    return false;
  });
  if (!detections.mask.empty() && (detections.mask.width() != width || detections.mask.height() != height)) {
    wrong = "a mask is of " + std::to_string(detections.mask.width()) + " x " +
            std::to_string(detections.mask.height()) + " px, the images of " + std::to_string(width) + " x " +
            std::to_string(height) + "; scale it to the image";
    detections.mask = {};
  }
  return {wrong, said_something && detections.boxes.empty() && detections.mask.empty()};
}

std::string DetectorFailures::told(const std::string& what) {
  return std::exchange(told_, what) == what ? "" : what;
}
std::string DetectorFailures::answered(const std::string& wrong) {
  failures_ = 0;
  return wrong.empty() ? "" : told(": " + wrong);
}
std::string DetectorFailures::failed(const std::string& wrong) {
  ++failures_;
  if (!given_up()) return told(" failed: " + wrong);
  return " failed " + std::to_string(kMost) + " times in a row: " + wrong + "; it is not asked again";
}
std::string DetectorFailures::ended(const std::string& wrong) {
  failures_ = kMost;
  return " failed: " + wrong + "; it is not asked again";
}

Detections asked(Detector& detector, const Frame& frame, int width, int height, DetectorFailures& failures,
                 std::string& warning) {
  Detections found;
  if (failures.given_up()) return found;
  try {
    found = detector.detect(detector_input(frame));
  } catch (const DetectorEnded& e) {
    warning = failures.ended(what_was_thrown());
    if (dynamic_cast<const NeverStarted*>(&e) != nullptr) failures.never_started = std::current_exception();
    return {};
  } catch (...) {
    warning = failures.failed(what_was_thrown());
    return {};
  }
  const Misfit misfit = make_fit(found, width, height);
  if (misfit.nothing_left)
    warning = failures.failed(misfit.what);
  else
    warning = failures.answered(misfit.what.empty() ? "" : misfit.what + "; it is left out");
  return found;
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
  Answer answer;
  answer.due = {task.index, task.frame.stamp_ns(), {}};
  answer.due.detections = asked(detector_, task.frame, width_, height_, failures_, answer.warning);
  if (!answer.warning.empty()) answer.warning = "the detector" + answer.warning;
  answer.failing = failures_.failing(), answer.given_up = failures_.given_up();
  answer.never_started = failures_.never_started;
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
    failing_ = answer->failing, failed_ = answer->given_up;
    if (!answer->failing) {
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
