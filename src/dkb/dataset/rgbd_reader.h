// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "dkb/dataset/tum_dataset.h"
#include "dkb/geometry/camera.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/util/bounded_queue.h"
#include "dkb/util/timing.h"

namespace dkb {

struct RgbdReaderOptions {
  int queue = 4;            // [pairs] decoded ahead of the consumer, 1 ... 1000
  bool threaded = true;     // false: next() decodes on the caller's thread; the frames are the same
  int probed = 5;           // [pairs] looked at before the first is handed out, >= 1
  bool fit_colour = false;  // colour images of another size are resampled to the camera's, to which depth belongs
  void check() const;       // throws InvalidOption
};

// One pair of the dataset, in order, decoded or skipped.
struct DatasetFrame {
  size_t index = 0;                        // in the list of pairs
  double timestamp = 0;                    // [s] colour
  std::string stamp;                       // colour, as read
  std::shared_ptr<const RgbdImage> image;  // null when skipped
  std::string skipped;                     // why, when skipped
};

// Decodes the pairs of a dataset in order, ahead of the consumer on a thread of its own. Not copyable; one consumer.
// The same dataset gives the same frames, whatever the timing.
class RgbdReader {
 public:
  // Probes the first pairs: throws InputError when none of them decodes, or when one that decodes has another size than
  // the camera or is of a wrong type (8-bit depth, ...). What the probe decodes is not decoded again.
  // Single bad pairs are handed out as skipped.
  RgbdReader(std::vector<DatasetPair> pairs, const CameraModel& camera, const RgbdReaderOptions& options);
  ~RgbdReader();  // stops the thread; never waits for more than the pair being decoded
  RgbdReader(const RgbdReader&) = delete;
  RgbdReader& operator=(const RgbdReader&) = delete;

  // Waits for the next pair. Nothing after the last one, and after stop().
  std::optional<DatasetFrame> next();
  // From any thread, any number of times: next() returns nothing from now on, also to a consumer that waits in it.
  void stop();

  size_t size() const { return pairs_.size(); }
  const std::vector<DatasetPair>& pairs() const { return pairs_; }
  // Stage "decoding", one sample per pair. Complete once next() has returned nothing.
  StageTimes times() const;

 private:
  struct Decoded;
  void probe();
  Decoded decode(size_t index) const;
  DatasetFrame deliver(size_t index);
  void run();

  const std::vector<DatasetPair> pairs_;
  const CameraModel camera_;
  const RgbdReaderOptions options_;
  std::vector<std::unique_ptr<Decoded>> probed_;  // by index; emptied as they are delivered
  BoundedQueue<DatasetFrame> queue_;
  std::atomic<bool> stopped_{false};
  size_t next_index_ = 0;  // without a thread
  mutable std::mutex times_mutex_;
  StageTimes times_;
  std::thread thread_;
};

}  // namespace dkb
