// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/util/timing.h"

namespace dkb {

struct DetectionSchedule {
  int every = 3;          // [frames] from one detection to the next, >= 1
  int latency = 3;        // [frames] after which a result is used, >= 0; covers the detector's p95 at 30 Hz
  bool threaded = true;   // false: detects inside push(), with the same results
  bool realtime = false;  // true: never waits but for the first result; work that piles up is dropped and counted
  void check() const;
};

// A result at the frame from which on it may be used.
struct DueDetections {
  int64_t frame = 0;  // index of the image it was made from
  Detections detections;
};

struct DetectionStats {
  std::string kind;
  int latency_frames = 0;
  double rate_hz = 0;  // results per second of the sequence
  size_t results = 0;
  size_t dropped = 0;  // images that the detector was too slow for (realtime only)
  size_t late = 0;     // results used after their due frame (realtime only)
};

// The detection stage beside tracking. The result of frame n is used from frame n + latency on, whenever the detector
// is done, so that runs of a dataset do not depend on time; the first result is waited for and used at its own frame,
// so that nobody gets into the map before. One producer and consumer (tracking); no result reaches it but through
// take_due(). A detector that throws ends the stage: take_due() at the due frame of that image delivers the error once.
class DetectionThread {
 public:
  DetectionThread(std::unique_ptr<Detector> detector, DetectionSchedule schedule);
  ~DetectionThread();  // as stop()
  DetectionThread(const DetectionThread&) = delete;
  DetectionThread& operator=(const DetectionThread&) = delete;

  // Offers the image of every frame, by increasing index; every `every`-th is taken. Returns whether this one was.
  bool push(int64_t frame, std::shared_ptr<const RgbdImage> image);

  // Results that became due at or before `frame` and were not taken yet, oldest first. Waits for them unless
  // `realtime`.
  std::vector<DueDetections> take_due(int64_t frame);

  // Whether the detector threw on an image whose result is due. From then on nothing is pushed or due any more.
  bool failed() const { return failed_; }
  // What it threw, once: the warning for the user.
  std::optional<std::string> take_error();

  // Lets the detection in work end, drops what waits, joins. Afterwards push() takes nothing.
  void stop();

  DetectionStats stats() const;
  // Stages "detection" and "wait_detector".
  StageTimes times() const;

 private:
  struct Job {
    int64_t frame = 0, due = 0;
    std::shared_ptr<const RgbdImage> image;
  };
  struct Result {
    int64_t due = 0;
    DueDetections value;
    std::optional<std::string> error;
    double ms = 0;
  };
  void work();
  Result run(const Job& job);
  void finish(Result result);

  const std::unique_ptr<Detector> detector_;
  const DetectionSchedule schedule_;

  // Tracking's own.
  std::optional<int64_t> next_frame_;  // earliest frame to push; none before the first
  int64_t first_frame_ = 0;
  bool failed_ = false;
  std::optional<std::string> error_;
  StageTimes wait_times_;
  DetectionStats stats_;
  double first_stamp_ = 0, last_stamp_ = 0;

  mutable std::mutex mutex_;  // guards what follows
  std::condition_variable job_ready_, result_ready_;
  std::deque<Job> jobs_;
  std::deque<int64_t> outstanding_;  // due frames of images pushed and not yet answered
  std::deque<Result> results_;
  StageTimes detection_times_;
  bool first_done_ = false;  // the first image is answered
  bool broken_ = false;      // the detector threw, though the error may not be due yet
  bool stopping_ = false;
  std::thread thread_;
};

}  // namespace dkb
