// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>

#include "types.h"

namespace dkb_ros {

struct ImagePair {
  ImageMessage colour, depth;
  bool clock_jumped = false;  // stamps went back: what came before belongs to another recording
};

// Joins colour and depth images by their stamps, the nearest to each other. A pair is given out as soon as no image
// that is still to come could fit better. A function of the messages in their order, and of no clock.
class Pairing {
 public:
  Pairing(int64_t tolerance_ns, size_t capacity) : tolerance_(tolerance_ns), capacity_(capacity) {}

  std::vector<ImagePair> add_colour(ImageMessage image) { return add(&colour_, std::move(image)); }
  std::vector<ImagePair> add_depth(ImageMessage image) { return add(&depth_, std::move(image)); }

  // The next images may have any stamps.
  void restart();

  int64_t unpaired() const { return unpaired_; }  // images without a partner
  int64_t late() const { return late_; }          // images whose stamp was not after the one before

 private:
  struct Stream {
    std::deque<ImageMessage> waiting;   // by stamp
    std::optional<ImageMessage> ahead;  // more than a second after the newest: waits until the next one confirms it
    std::optional<int64_t> newest;      // stamp
    int64_t period = 0;                 // [ns] median of the last intervals, 0 = not known
    std::deque<int64_t> intervals;      // [ns] the last ones
    int far_behind = 0;                 // images in a row that were more than a second late
  };

  std::vector<ImagePair> add(Stream* stream, ImageMessage image);
  std::vector<ImagePair> match();
  bool hold(Stream* stream, ImageMessage* image);
  void enter(Stream* stream, ImageMessage image);
  bool accept(Stream* stream, const ImageMessage& image);
  void forget_images();
  void drop_first(Stream* stream);

  int64_t tolerance_;
  size_t capacity_;
  Stream colour_, depth_;
  std::optional<int64_t> last_pair_;  // stamp of its colour image
  bool clock_jumped_ = false;
  int64_t unpaired_ = 0, late_ = 0;
};

}  // namespace dkb_ros
