// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detection_thread.h"

#include <exception>
#include <utility>

#include "dkb/util/errors.h"
#include "dkb/util/thread_priority.h"

namespace dkb {

void DetectionSchedule::check() const {
  require_option(every >= 1, "every", every, ">= 1");
  require_option(latency >= 0, "latency", latency, ">= 0");
}

DetectionThread::DetectionThread(std::unique_ptr<Detector> detector, DetectionSchedule schedule)
    : detector_(std::move(detector)), schedule_(schedule) {
  schedule_.check();
  stats_.kind = detector_->kind();
  stats_.latency_frames = schedule_.latency;
  if (schedule_.threaded) thread_ = std::thread([this] { work(); });
}

DetectionThread::~DetectionThread() {
  stop();
}

bool DetectionThread::push(int64_t frame, std::shared_ptr<const RgbdImage> image) {
  if (failed_ || (next_frame_ && frame < *next_frame_)) return false;
  const bool first = !next_frame_;
  Job job{frame, first ? frame : frame + schedule_.latency, std::move(image)};
  std::unique_lock lock(mutex_);
  if (stopping_) return false;
  next_frame_ = frame + schedule_.every;
  if (first) first_frame_ = frame;
  if (broken_) return true;  // the same answer as before the failure is known; its result will end the stage
  if (schedule_.realtime && !jobs_.empty() && jobs_.back().frame != first_frame_) {
    jobs_.pop_back();  // beside the image in work at most one waits, the newest; the first is never dropped
    outstanding_.pop_back();
    ++stats_.dropped;
  }
  outstanding_.push_back(job.due);
  if (schedule_.threaded) {
    jobs_.push_back(std::move(job));
    job_ready_.notify_one();
    return true;
  }
  lock.unlock();
  finish(run(job));
  return true;
}

std::vector<DueDetections> DetectionThread::take_due(int64_t frame) {
  const Stopwatch watch;
  std::unique_lock lock(mutex_);
  bool waited = false;
  while (!outstanding_.empty() && outstanding_.front() <= frame && (!schedule_.realtime || !first_done_)) {
    waited = true;
    result_ready_.wait(lock);
  }
  if (waited) wait_times_.add("wait_detector", watch.ms());
  std::vector<DueDetections> due;
  while (!results_.empty() && results_.front().due <= frame && !failed_) {
    Result result = std::move(results_.front());
    results_.pop_front();
    if (result.error) {
      failed_ = true;
      error_ = std::move(result.error);
      break;
    }
    if (stats_.results == 0) first_stamp_ = result.value.detections.timestamp;
    last_stamp_ = result.value.detections.timestamp;
    ++stats_.results;
    if (schedule_.realtime && result.due < frame) ++stats_.late;
    due.push_back(std::move(result.value));
  }
  return due;
}

std::optional<std::string> DetectionThread::take_error() {
  return std::exchange(error_, std::nullopt);
}

void DetectionThread::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    jobs_.clear();
    outstanding_.clear();
    job_ready_.notify_all();
  }
  if (thread_.joinable()) thread_.join();
}

DetectionStats DetectionThread::stats() const {
  DetectionStats stats = stats_;
  if (stats.results > 1 && last_stamp_ > first_stamp_)
    stats.rate_hz = static_cast<double>(stats.results - 1) / (last_stamp_ - first_stamp_);
  return stats;
}

StageTimes DetectionThread::times() const {
  const std::lock_guard lock(mutex_);
  StageTimes times = detection_times_;
  times.merge(wait_times_);
  return times;
}

void DetectionThread::work() {
  set_thread_priority(ThreadPriority::background);
  for (;;) {
    Job job;
    {
      std::unique_lock lock(mutex_);
      job_ready_.wait(lock, [&] { return stopping_ || !jobs_.empty(); });
      if (stopping_) return;
      job = std::move(jobs_.front());
      jobs_.pop_front();
    }
    finish(run(job));
  }
}

DetectionThread::Result DetectionThread::run(const Job& job) {
  Result result{job.due, {job.frame, {}}, std::nullopt, 0};
  const Stopwatch watch;
  try {
    result.value.detections = detector_->detect(*job.image);
  } catch (const std::exception& e) {
    result.error = e.what();
  } catch (...) {
    result.error = "unknown failure";
  }
  result.ms = watch.ms();
  return result;
}

void DetectionThread::finish(Result result) {
  const std::lock_guard lock(mutex_);
  detection_times_.add("detection", result.ms);
  first_done_ = true;
  if (!outstanding_.empty()) outstanding_.pop_front();
  if (result.error) {
    broken_ = true;
    jobs_.clear();
    outstanding_.clear();
  }
  results_.push_back(std::move(result));
  result_ready_.notify_all();
}

}  // namespace dkb
