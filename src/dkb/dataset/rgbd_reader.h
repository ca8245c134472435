// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
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
#include "dkb/util/timing.h"

namespace dkb {

struct RgbdReaderOptions {
  int queue = 4;         // [pairs] ahead of the consumer, decoded or being decoded, 1 ... 1000
  int workers = 2;       // [threads] that decode a pair each, 1 ... 16
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

// Decodes the pairs of a recording ahead of the consumer, several at once, and hands them out in order. Not copyable;
// one consumer. The same recording gives the same frames, whatever the timing.
class RgbdReader {
 public:
  // Probes the first pairs: throws InputError when none of them decodes, or when one that decodes has another size than
  // the camera or is of a wrong type (8-bit depth, ...). What the probe decodes is not decoded again.
  // Single bad pairs are handed out as skipped.
  RgbdReader(PairStream pairs, const RgbdReaderOptions& options);
  RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options);
  ~RgbdReader();  // stops the workers; never waits for more than the pairs being decoded
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
  struct Slot;
  void probe();
  void run();
  void end();
  // The next pair of the recording. One thread at a time.
  std::optional<Probed> fetch();
  static Decoded decode(const StoredPair& pair);
  static Slot decoded(Probed pair, size_t index);
  DatasetFrame hand_out(Slot slot);

  const PairStream pairs_;
  const RgbdReaderOptions options_;
  std::deque<Probed> probed_;
  std::vector<int64_t> first_stamps_;

  mutable std::mutex mutex_;         // guards what follows
  std::condition_variable room_;     // for a worker to begin the next pair
  std::condition_variable decoded_;  // the oldest pair, or the recording has ended
  std::deque<Slot> ahead_;           // in the recording's order; a worker fills the slot that it added
  size_t next_index_ = 0;
  bool fetching_ = false, ended_ = false, stopped_ = false;
  std::exception_ptr failure_;  // of the stream of pairs, after its last pair
  StageTimes times_;
  std::vector<std::thread> workers_;
};

}  // namespace dkb
