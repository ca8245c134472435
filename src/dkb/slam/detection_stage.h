// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb/image/rgbd_image.h"
#include "dkb/map/ids.h"
#include "dkb/util/due_stage.h"
#include "dkb/util/timing.h"
#include "dkb_slam/detector.h"

namespace dkb {

// An answer of the slow detector at the frame from which on it counts.
struct DueDetections {
  FrameIndex frame = 0;  // whose image it was made from
  int64_t stamp_ns = 0;  // of that image
  Detections detections;
};

// What becomes of a detector that fails. While it does, nothing is known of its images; when it has failed so often in
// a row, it is not asked any more. People are told each cause once in a row.
class DetectorFailures {
 public:
  // As many as stamps that do not rise (RisingStamps): a second, where every third image is asked for.
  static constexpr int kMost = 10;

  // Of one answer. `wrong`: what was wrong with it, or nothing. What to tell people, or nothing.
  std::string answered(const std::string& wrong);
  std::string failed(const std::string& wrong);
  std::string ended(const std::string& wrong);  // it can give no answer any more
  bool failing() const { return failures_ > 0; }
  bool given_up() const { return failures_ >= kMost; }

  std::exception_ptr never_started;  // what it threw, if so

 private:
  std::string told(const std::string& what);

  int failures_ = 0;  // in a row
  std::string told_;
};

// Detection beside tracking. Every n-th image goes to the detector, and its answer counts a fixed number of frames
// later. The first answer is waited for and counts at its own frame, so that nobody gets into the map before.
// While the detector fails its answers are empty, so that what it saw last is not carried for ever. Only one that never
// started is refused, while the first answer is waited for.
class DetectionStage {
 public:
  // The detector must outlive the stage. In a real-time run answers are not waited for, but for the first, and that one
  // for a few seconds at most; images that the detector is too slow for are left out.
  DetectionStage(Detector& detector, const Camera& camera, const DetectionSchedule& schedule, bool threaded,
                 bool realtime);

  // Offers the image of a frame, by increasing index; one that was offered already is left alone.
  void offer(FrameIndex index, const Frame& frame);
  // Whether the next answer counts at its own frame, which must be offered first.
  bool answers_at_once() const { return next_ == 0 || schedule_.latency == 0; }
  // What counts from this frame on, oldest first. Throws NeverStarted.
  std::vector<DueDetections> take_due(FrameIndex index);
  // For real-time runs: while on, the detector rests as long as its last answer took, in frames.
  void rest(bool on) { rests_ = on; }
  std::vector<std::string> take_warnings();

  // As of the last take_due(): its last answer failed; it is not asked any more.
  bool failing() const { return failing_; }
  bool failed() const { return failed_; }
  double rate_hz() const;  // answers per second of the sequence
  // Durations of detection and wait_detector since they were taken last.
  StageTimes take_times() { return times_.take(); }

 private:
  struct Task {
    FrameIndex index = 0;
    Frame frame;
  };
  struct Answer {
    DueDetections due;
    bool failing = false, given_up = false;
    std::exception_ptr never_started;
    std::string warning;
    double ms = 0;
  };
  Answer detect(const Task& task);
  std::optional<Answer> take(FrameIndex index);

  Detector& detector_;
  const int width_, height_;
  const DetectionSchedule schedule_;
  const bool realtime_;
  FrameIndex next_ = 0;        // the earliest frame to be offered
  FrameIndex rest_until_ = 0;  // the earliest one while it rests
  bool rests_ = false;
  DetectorFailures failures_;  // the stage's thread's
  bool answered_ = false, failing_ = false, failed_ = false;
  size_t answers_ = 0;
  int64_t first_stamp_ = 0, last_stamp_ = 0;  // [ns] of answers
  std::vector<std::string> warnings_;
  StageTimes times_;
  DueStage<Task, Answer> stage_;  // last: its thread uses the above
};

// What the detector says of a frame, as far as it fits the image; nothing when it fails, which an answer does of which
// nothing fits, or is given up. `warning` becomes what to tell people after the detector's name, if anything.
Detections asked(Detector& detector, const Frame& frame, int width, int height, DetectorFailures& failures,
                 std::string& warning);

// What did not fit the image in a detector's answer.
struct Misfit {
  std::string what;           // with the remedy; empty = all fits
  bool nothing_left = false;  // of an answer that said something: it is none, not that nobody is there
};

// Takes what lies outside the image out of `detections`, and a mask of another size.
Misfit make_fit(Detections& detections, int width, int height);

}  // namespace dkb
