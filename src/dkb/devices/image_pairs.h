// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "dkb/util/rising_stamps.h"
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

// Stamps lie between zero and this, 97 years, so that sums and differences of two can be computed with.
constexpr int64_t kMaxStampNs = INT64_MAX / 3;
inline bool is_stamp(int64_t ns) {
  return ns >= 0 && ns <= kMaxStampNs;
}

// Pairs images of two streams, each colour image with the depth image of the nearest stamp that is as near as the
// lists of a folder allow, each used once. An image whose stamp is not after the one before in its stream, or is none,
// is left out; after ten such images in a row whose own stamps rise (RisingStamps) what waits with later stamps is, and
// theirs count. A pair far ahead of the one before waits for the next colour image to say that time is there.
class ImagePairs {
 public:
  void add(const DeviceImage& image, bool is_depth);
  // The next pair that nothing still to come can better.
  std::optional<ImagePair> take();
  // No more images will come.
  void close() { closed_ = true; }
  // What waits is forgotten: the device was unplugged.
  void restart();

  // A clock was set back to before the last pair: images are left out until it has come past that, or restart().
  bool behind() const { return colour_.stamps.behind() || depth_.stamps.behind(); }

  int64_t unpaired() const { return unpaired_; }  // images that found no partner
  int64_t late() const { return late_; }          // images left out

 private:
  struct Stream {
    std::deque<KeptImage> waiting;
    RisingStamps stamps;
    int64_t interval = 0;  // [ns] between the last two
  };
  void drop_front(Stream& stream) { stream.waiting.pop_front(), ++unpaired_; }

  Stream colour_, depth_;
  std::optional<int64_t> taken_;  // stamp of the last pair's colour image
  int64_t unpaired_ = 0, late_ = 0;
  bool closed_ = false;
};

}  // namespace dkb
