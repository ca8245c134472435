// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/paced_source.h"

#include <deque>
#include <utility>

#include "dkb/image/skipped_motion.h"

namespace dkb {
namespace {

// A recording whose clock jumps would keep its consumer waiting: what comes after so long a pause comes at once.
constexpr int64_t kLongestPauseNs = 10'000'000'000;

PacedSource::Due by_stamps() {
  return [last = std::optional<int64_t>(), at = std::chrono::nanoseconds(0)](const SourceFrame& frame) mutable {
    std::optional<std::chrono::nanoseconds> due;
    if (frame.state != SourceState::frame) return due;
    const int64_t stamp = frame.frame.stamp_ns();
    // As an unsigned difference, which does not overflow.
    const uint64_t pause = last && stamp > *last ? static_cast<uint64_t>(stamp) - static_cast<uint64_t>(*last) : 0;
    if (pause < static_cast<uint64_t>(kLongestPauseNs)) at += std::chrono::nanoseconds(pause);
    if (!last || stamp > *last) last = stamp;
    due = at;
    return due;
  };
}

}  // namespace

PacedSource::PacedSource(Source& source) : source_(source), due_(by_stamps()), thread_([this] { run(); }) {}

PacedSource::PacedSource(std::unique_ptr<Source> source, Due due)
    : owned_(std::move(source)), source_(*owned_), due_(std::move(due)), thread_([this] { run(); }) {}

std::unique_ptr<PacedSource> PacedSource::of_device(std::unique_ptr<Source> device) {
  return std::make_unique<PacedSource>(std::move(device), [](const SourceFrame&) { return std::nullopt; });
}

PacedSource::~PacedSource() {
  stop();
  thread_.join();
}

SourceFrame PacedSource::next() {
  {
    const std::lock_guard lock(mutex_);
    asked_ = true;
  }
  wake_.notify_all();
  if (std::optional<SourceFrame> frame = queue_.pop()) return std::move(*frame);
  const std::lock_guard lock(mutex_);
  if (failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
  return {};
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

PacedSource::Clock::time_point PacedSource::now() const {
  return (held_since_ ? *held_since_ : Clock::now()) - held_;
}

bool PacedSource::wait_until(Clock::time_point due) {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [&] { return stopped_ || !held_since_; });
    if (stopped_) return false;
    if (!wake_.wait_until(lock, due + held_, [&] { return stopped_ || held_since_; })) return true;
  }
}

// A recording decodes another frame when one is taken from it: better while the consumer rests than while it works.
bool PacedSource::wait_until_asked(std::chrono::nanoseconds at_most) {
  std::unique_lock lock(mutex_);
  wake_.wait_for(lock, at_most, [&] { return stopped_ || asked_; });
  return !stopped_;
}

SourceCounts PacedSource::counts() const {
  SourceCounts counts = source_.counts();
  counts.dropped += dropped_;
  counts.late += late_;
  return counts;
}

void PacedSource::run() {
  std::optional<Clock::time_point> start;
  std::optional<int64_t> last_stamp;
  SkippedMotion left_out;  // since the last frame that waits in the queue
  const auto leave_motion = [&](const SourceFrame& dropped, std::deque<SourceFrame>& waiting) {
    if (dropped.state != SourceState::frame) return;
    SkippedMotion motion;
    motion.skip(dropped.frame);
    for (SourceFrame& next : waiting)
      if (next.state == SourceState::frame) {
        next.frame = motion.with_motion(std::move(next.frame));
        return;
      }
    left_out.skip(dropped.frame);
  };
  std::optional<std::chrono::nanoseconds> last_due;
  std::chrono::nanoseconds interval{};  // between the last two frames
  try {
    for (;;) {
      SourceFrame frame = source_.next();
      const auto due = due_(frame);
      if (due) {
        if (last_due) interval = *due - *last_due;
        last_due = due;
        const Clock::time_point at = [&] {
          const std::lock_guard lock(mutex_);
          return now();
        }();
        if (!start) start = at - *due;
        if (!wait_until(*start + *due)) break;
      }
      if (frame.state == SourceState::ended) break;
      if (frame.state == SourceState::frame) {
        const int64_t stamp = frame.frame.stamp_ns();
        if (last_stamp && stamp <= *last_stamp) {
          ++late_;
          left_out.skip(frame.frame);
          continue;
        }
        last_stamp = stamp;
        frame.frame = left_out.with_motion(std::move(frame.frame));
        left_out = {};
      }
      {
        const std::lock_guard lock(mutex_);
        asked_ = false;
      }
      dropped_ += static_cast<int>(queue_.push_dropping_oldest(std::move(frame), leave_motion));
      if (due && !wait_until_asked(interval)) break;
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    failure_ = std::current_exception();
  }
  queue_.close();
}

}  // namespace dkb
