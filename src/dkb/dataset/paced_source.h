// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <thread>

#include "dkb/dataset/rgbd_reader.h"
#include "dkb/util/bounded_queue.h"

namespace dkb {

// Hands the frames of a dataset over at the pace of their stamps, as a camera would. A consumer that falls behind finds
// up to 30 frames waiting; only when these are full is the oldest dropped and counted.
class PacedSource {
 public:
  explicit PacedSource(RgbdReader& reader);
  ~PacedSource();
  PacedSource(const PacedSource&) = delete;
  PacedSource& operator=(const PacedSource&) = delete;

  // Waits for the next frame; nothing after the last one or stop().
  std::optional<DatasetFrame> next() { return queue_.pop(); }
  void stop();
  int dropped() const { return dropped_; }

 private:
  void run();

  RgbdReader& reader_;
  BoundedQueue<DatasetFrame> queue_{30};
  std::atomic<int> dropped_{0};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace dkb
