// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/paced_source.h"

#include "dkb/image/skipped_motion.h"

namespace dkb {

PacedSource::PacedSource(Source& source) : source_(source), thread_([this] { run(); }) {}

PacedSource::~PacedSource() {
  stop();
  thread_.join();
}

void PacedSource::stop() {
  source_.stop();
  {
    std::unique_lock lock(mutex_);
    stopped_ = true;
  }
  wake_.notify_all();
  queue_.close();
}

void PacedSource::hold(bool on) {
  {
    const std::lock_guard lock(mutex_);
    if (on == held_since_.has_value()) return;
    if (on) {
      held_since_ = Clock::now();
    } else {
      held_ += Clock::now() - *held_since_;
      held_since_.reset();
    }
  }
  wake_.notify_all();
}

bool PacedSource::wait_until(Clock::time_point due) {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return stopped_ || !held_since_; });
    if (stopped_) return false;
    if (!wake_.wait_until(lock, due + held_, [&] { return stopped_ || held_since_; })) return true;
  }
}

void PacedSource::run() {
  std::optional<Clock::time_point> start;
  int64_t first_stamp = 0;
  for (SourceFrame frame = source_.next(); frame.state != SourceState::ended; frame = source_.next()) {
    // A pair that cannot be read is told at once: it has no stamp to wait for.
    if (frame.state == SourceState::frame) {
      if (!start) {
        start = Clock::now();
        first_stamp = frame.frame.stamp_ns();
      }
      const auto due = *start + std::chrono::nanoseconds(frame.frame.stamp_ns() - first_stamp);
      if (!wait_until(due)) break;
    }
    const auto leave_motion = [](const SourceFrame& dropped, SourceFrame& next) {
      if (dropped.state != SourceState::frame || next.state != SourceState::frame) return;
      SkippedMotion skipped;
      skipped.skip(dropped.frame);
      next.frame = skipped.with_motion(std::move(next.frame));
    };
    dropped_ += static_cast<int>(queue_.push_dropping_oldest(std::move(frame), leave_motion));
  }
  queue_.close();
}

}  // namespace dkb
