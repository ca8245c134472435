// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/paced_source.h"

#include <chrono>

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

void PacedSource::run() {
  using Clock = std::chrono::steady_clock;
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
      std::unique_lock lock(mutex_);
      if (wake_.wait_until(lock, due, [&] { return stopped_; })) break;
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
