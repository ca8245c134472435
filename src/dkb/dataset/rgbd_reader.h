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
  bool threaded = true;  // false: next() decodes on the caller's thread; the frames are the same
};

// One pair of the recording, in order, decoded or skipped.
struct DatasetFrame {
  size_t index = 0;                          // of the pair, skipped ones counted
  int64_t stamp_ns = 0, depth_stamp_ns = 0;  // exactly
  std::string stamp;                         // colour, as read
  std::shared_ptr<const RgbdImage> image;    // null when skipped
  std::optional<MotionPrior> prior;          // of the motion since the pair before
  std::string skipped;                       // why, when skipped
};

// Decodes the pairs of a recording ahead of the consumer, several at once, and hands them out in order. Not copyable;
// one consumer. The same recording gives the same frames, whatever the timing. Decoding takes what time of the cores
// nobody else wants; for a consumer that waits one more thread decodes, so that a recording is read where other
// programs leave no such time, too.
class RgbdReader {
 public:
  // Probes the first pairs: throws InputError when none of them decodes, or when one that decodes has another size than
  // the camera or is of a wrong type (8-bit depth, ...). What the probe decodes is not decoded again.
  // Single bad pairs are handed out as skipped.
  RgbdReader(PairStream pairs, const RgbdReaderOptions& options);
  RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options);
  ~RgbdReader();  // stops the threads; never waits for more than the pairs being decoded
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
  struct Slot;
  using Slots = std::deque<std::shared_ptr<Slot>>;  // in the recording's order
  void probe();
  void fetch_ahead();
  void fetch_one(std::unique_lock<std::mutex>& lock);
  void decode_ahead();
  void end();
  // The next pair of the recording, nothing at its end. One thread at a time.
  std::shared_ptr<Slot> fetch();
  static Decoded decode(const StoredPair& pair);
  // Decodes without the lock. Two threads may do so at once; the first result counts.
  void fill(std::unique_lock<std::mutex>& lock, const std::shared_ptr<Slot>& slot);
  std::shared_ptr<Slot> next_to_decode() const;  // nothing when all pairs ahead are decoded or being decoded
  std::shared_ptr<Slot> waited_for() const;      // what to decode for a consumer that waits
  bool oldest_ready() const;                     // so is the end of the recording
  bool full() const;                             // no more pairs will come before one is handed out
  DatasetFrame hand_out(Slot& slot);

  const PairStream pairs_;
  const RgbdReaderOptions options_;
  Slots probed_;
  std::vector<int64_t> first_stamps_;

  mutable std::mutex mutex_;         // guards what follows
  std::condition_variable room_;     // for one more pair ahead, or the consumer waits
  std::condition_variable fetched_;  // a pair to decode, or the recording has ended
  std::condition_variable changed_;  // a pair fetched or decoded, or the recording has ended
  Slots ahead_;
  size_t next_index_ = 0;  // of the thread that fetches
  bool ended_ = false, stopped_ = false, waiting_ = false;
  std::exception_ptr failure_;  // of the stream of pairs, after its last pair
  StageTimes times_;
  std::vector<std::thread> threads_;
};

}  // namespace dkb
