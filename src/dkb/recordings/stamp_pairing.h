// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "dkb/util/rising_stamps.h"

namespace dkb {

// Pairs colour and depth images by their stamps while they arrive, as associate() does for whole lists: one to one,
// nearest first, ties earlier. A pair is told as soon as no image that is known or may still come could be nearer to
// either of the two. What waits is bounded: an image far behind the newest of its kind, and the oldest of too many or
// too large ones, is taken with the nearest that is there, or left over. A pair far ahead of the one before waits for
// the next colour image to say that time is there, since nothing before it could follow.
class StampPairing {
 public:
  enum Kind { colour, depth };
  struct Stored {
    int64_t stamp_ns = 0;
    std::string bytes;
  };
  struct Pair {
    Stored colour, depth;
  };
  static constexpr double kPatience = 2;         // [s] and
  static constexpr size_t kPatienceImages = 30;  // newer ones of its kind, until an image is far behind
  static constexpr size_t kMaxWaiting = 256;     // [images] of one kind
  static constexpr size_t kMaxBytes = 1 << 29;   // of all that wait

  // False, and nothing is added, when the stamp is not after that of the last image of this kind. After ten of these in
  // a row whose own stamps rise (RisingStamps) what waits with later stamps is left over, and theirs count.
  bool add(Kind kind, Stored image);
  // No more images will come.
  void close();
  // The next pair by colour stamps; nothing when more images must be added first, or all have been told.
  std::optional<Pair> take();
  // Images that were left over so far.
  int64_t unpaired() const { return unpaired_; }
  // Images refused in a row up to now, where a clock was set back to before the last pair taken.
  int64_t behind() const;

 private:
  enum class State { waiting, paired, left_over };
  struct Waiting {
    double time = 0;  // [s]
    State state = State::waiting;
    Stored image;
    Stored partner;  // of colour images that are paired
  };
  struct Side {
    std::deque<Waiting> images;
    RisingStamps stamps;
    double last = 0;         // [s] of the last one
    double beyond = -1e300;  // [s] where those lie that are still to come
  };

  // The nearest one that waits on the other side; earlier ones go first.
  std::optional<size_t> nearest(Kind kind, const Waiting& image) const;
  bool could_still_be_nearer(Kind kind, const Waiting& image, double difference) const;
  bool could_still_pair(Kind kind, const Waiting& image) const;
  void forget_from(Kind kind, int64_t stamp_ns);
  bool far_ahead(const Waiting& colour_image) const;
  void join(size_t colour_index, size_t depth_index);
  void resolve();
  void bound();

  std::optional<double> taken_;  // [s] of the last pair's colour image
  std::array<Side, 2> sides_;
  size_t bytes_ = 0;
  int64_t unpaired_ = 0;
  bool closed_ = false;
};

}  // namespace dkb
