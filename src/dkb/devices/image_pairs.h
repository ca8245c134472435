// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "dkb_slam/image.h"

namespace dkb {

// An image as a device gives it.
struct DeviceImage {
  ImageView view;
  int64_t stamp_ns = 0;
};

// An image that was kept.
struct KeptImage {
  std::vector<uint8_t> bytes;
  ImageView view;  // of these bytes
  int64_t stamp_ns = 0;

  KeptImage() = default;
  explicit KeptImage(const DeviceImage& image);
  KeptImage(KeptImage&&) = default;
  KeptImage& operator=(KeptImage&&) = default;
};

struct ImagePair {
  KeptImage colour, depth;
};

// Pairs images of two streams, each colour image with the depth image of the nearest stamp within 20 ms, each used
// once. An image whose stamp is not after the one before in its stream is left out.
class ImagePairs {
 public:
  void add(const DeviceImage& image, bool is_depth);
  // The next pair that nothing still to come can better.
  std::optional<ImagePair> take();
  // What waits is forgotten: the device was unplugged.
  void restart();

  int64_t unpaired() const { return unpaired_; }  // images that found no partner
  int64_t late() const { return late_; }          // images left out

 private:
  struct Stream {
    std::deque<KeptImage> waiting;
    std::optional<int64_t> last;  // stamp
    int64_t interval = 0;         // [ns] between the last two
  };
  void drop_front(Stream& stream) { stream.waiting.pop_front(), ++unpaired_; }

  Stream colour_, depth_;
  int64_t unpaired_ = 0, late_ = 0;
};

}  // namespace dkb
