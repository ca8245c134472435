// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "dkb/util/bounded_queue.h"
#include "dkb_slam/source.h"

namespace dkb {

// Frames as they come in live: at the pace of a recording's stamps, or at that of the device that gives them. Takes
// them on a thread of its own. A consumer that falls behind finds up to 30 frames waiting; only when these are full is
// the oldest dropped and counted. Frames whose stamps do not rise are left out and counted: tracking needs rising
// stamps.
class PacedSource final : public Source {
 public:
  // When a frame, or the end, is to be handed over, counted from the start; nothing = at once.
  using Due = std::function<std::optional<std::chrono::nanoseconds>(const SourceFrame&)>;

  // At the pace of the stamps. A pair that cannot be read has none and is told at once.
  explicit PacedSource(Source& source);
  PacedSource(std::unique_ptr<Source> source, Due due);
  // As the device gives them.
  static std::unique_ptr<PacedSource> of_device(std::unique_ptr<Source> device);
  ~PacedSource() override;

  const Camera& camera() const override { return source_.camera(); }
  SourceFrame next() override;
  void stop() override;
  // While held the clock stands still.
  void hold(bool on);
  std::vector<std::string> take_warnings() override { return source_.take_warnings(); }
  SourceCounts counts() const override;
  std::optional<size_t> size() const override { return source_.size(); }
  std::string description() const override { return source_.description(); }

 private:
  using Clock = std::chrono::steady_clock;

  void run();
  Clock::time_point now() const;           // of the clock that can be held; `mutex_` is locked
  bool wait_until(Clock::time_point due);  // by that clock; false when stopped
  bool wait_until_asked(std::chrono::nanoseconds at_most);

  const std::unique_ptr<Source> owned_;
  Source& source_;
  const Due due_;
  BoundedQueue<SourceFrame> queue_{30};
  std::atomic<int> dropped_{0}, late_{0};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopped_ = false;
  bool asked_ = false;  // for a frame since the last one was put into the queue
  std::optional<Clock::time_point> held_since_;
  Clock::duration held_{};      // altogether, but for the time since then
  std::exception_ptr failure_;  // of the thread; written before the queue is closed
  std::thread thread_;
};

}  // namespace dkb
