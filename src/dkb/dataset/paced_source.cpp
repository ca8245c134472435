// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/paced_source.h"

#include <chrono>

namespace dkb {

PacedSource::PacedSource(RgbdReader& reader) : reader_(reader), thread_([this] { run(); }) {}

PacedSource::~PacedSource() {
  stop();
  thread_.join();
}

void PacedSource::stop() {
  reader_.stop();
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
  double first_stamp = 0;
  while (auto frame = reader_.next()) {
    if (!start) {
      start = Clock::now();
      first_stamp = frame->timestamp;
    }
    const auto due = *start + std::chrono::duration_cast<Clock::duration>(
                                  std::chrono::duration<double>(frame->timestamp - first_stamp));
    {
      std::unique_lock lock(mutex_);
      if (wake_.wait_until(lock, due, [&] { return stopped_; })) break;
    }
    dropped_ += static_cast<int>(queue_.push_dropping_oldest(std::move(*frame)));
  }
  queue_.close();
}

}  // namespace dkb
