// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "dkb/dataset/stored_pair.h"
#include "dkb/util/bounded_queue.h"
#include "dkb/util/timing.h"

namespace dkb {

struct RgbdReaderOptions {
  int queue = 4;         // [pairs] decoded ahead of the consumer, 1 ... 1000
  bool threaded = true;  // false: next() decodes on the caller's thread; the frames are the same
  int probed = 5;        // [pairs] looked at before the first is handed out, >= 1
  void check() const;    // throws InvalidOption
};

// One pair of the recording, in order, decoded or skipped.
struct DatasetFrame {
  size_t index = 0;                          // of the pair, skipped ones counted
  double timestamp = 0;                      // [s] colour
  int64_t stamp_ns = 0, depth_stamp_ns = 0;  // exactly
  std::string stamp;                         // colour, as read
  std::shared_ptr<const RgbdImage> image;    // null when skipped
  std::optional<MotionPrior> prior;          // of the motion since the pair before
  std::string skipped;                       // why, when skipped
};

// Decodes the pairs of a recording in order, ahead of the consumer on a thread of its own. Not copyable; one consumer.
// The same recording gives the same frames, whatever the timing.
class RgbdReader {
 public:
  // Probes the first pairs: throws InputError when none of them decodes, or when one that decodes has another size than
  // the camera or is of a wrong type (8-bit depth, ...). What the probe decodes is not decoded again.
  // Single bad pairs are handed out as skipped.
  RgbdReader(PairStream pairs, const RgbdReaderOptions& options);
  RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options);
  ~RgbdReader();  // stops the thread; never waits for more than the pair being decoded
  RgbdReader(const RgbdReader&) = delete;
  RgbdReader& operator=(const RgbdReader&) = delete;

  // Waits for the next pair. Nothing after the last one, and after stop(). Throws what the stream of pairs throws.
  std::optional<DatasetFrame> next();
  // From any thread, any number of times: next() returns nothing from now on, also to a consumer that waits in it.
  void stop();

  // Colour stamps of the pairs that were probed.
  const std::vector<int64_t>& first_stamps() const { return first_stamps_; }
  // Stage "decoding", one sample per pair. Complete once next() has returned nothing.
  StageTimes times() const;

 private:
  struct Decoded;
  struct Probed;
  void probe();
  static Decoded decode(const StoredPair& pair);
  std::optional<DatasetFrame> read();
  void run();

  const PairStream pairs_;
  const RgbdReaderOptions options_;
  std::deque<Probed> probed_;
  std::vector<int64_t> first_stamps_;
  BoundedQueue<DatasetFrame> queue_;
  std::atomic<bool> stopped_{false};
  size_t next_index_ = 0;
  mutable std::mutex mutex_;
  StageTimes times_;
  std::exception_ptr failure_;  // of the thread
  std::thread thread_;
};

}  // namespace dkb
