// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "dkb/util/bounded_queue.h"
#include "dkb_slam/source.h"

namespace dkb {

// Hands the frames of a recording over at the pace of their stamps, as a camera would. A consumer that falls behind
// finds up to 30 frames waiting; only when these are full is the oldest dropped and counted.
class PacedSource final : public Source {
 public:
  explicit PacedSource(Source& source);
  ~PacedSource() override;

  const Camera& camera() const override { return source_.camera(); }
  SourceFrame next() override { return queue_.pop().value_or(SourceFrame{}); }
  void stop() override;
  // While held the clock stands still.
  void hold(bool on);
  std::optional<size_t> size() const override { return source_.size(); }
  std::string description() const override { return source_.description(); }
  int dropped() const { return dropped_; }

 private:
  using Clock = std::chrono::steady_clock;

  void run();
  bool wait_until(Clock::time_point due);  // by the clock that can be held; false when stopped

  Source& source_;
  BoundedQueue<SourceFrame> queue_{30};
  std::atomic<int> dropped_{0};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopped_ = false;
  std::optional<Clock::time_point> held_since_;
  Clock::duration held_{};  // altogether, but for the time since then
  std::thread thread_;
};

}  // namespace dkb
