// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

namespace dkb {

// Which images of a stream are taken: those whose stamps rise. One stamp far ahead, or a clock that is set back, would
// make all that follow late for ever: after so many refusals in a row whose own stamps rise the stream goes on from
// these, though never from before `floor`, which what was handed on already must not fall behind.
class RisingStamps {
 public:
  static constexpr int kMostRefused = 10;
  static constexpr double kFarAhead = 2;  // [s] after the pair before, a pair waits for another image to say so too
  enum class Answer {
    taken,
    refused,
    set_back  // taken; what was taken before with the same or a later stamp is to be forgotten
  };

  Answer take(int64_t stamp_ns) {
    if (!last_ || stamp_ns > *last_) return accept(stamp_ns, Answer::taken);
    refused_ = refused_ > 0 && stamp_ns > last_refused_ ? refused_ + 1 : 1;
    last_refused_ = stamp_ns;
    if (refused_ < kMostRefused || stamp_ns <= floor_) return Answer::refused;
    return accept(stamp_ns, Answer::set_back);
  }
  // What was taken up to this stamp has been handed on.
  void hand_on(int64_t stamp_ns) { floor_ = stamp_ns; }

  // Of the one taken last.
  std::optional<int64_t> last() const { return last_; }
  // In a row, up to now.
  int refused() const { return refused_; }
  // The clock runs, but before what was handed on: nothing can be taken until it has come past that.
  bool behind() const { return refused_ >= kMostRefused; }

 private:
  Answer accept(int64_t stamp_ns, Answer answer) {
    last_ = stamp_ns, refused_ = 0;
    return answer;
  }

  std::optional<int64_t> last_;
  int64_t last_refused_ = 0, floor_ = std::numeric_limits<int64_t>::min();
  int refused_ = 0;
};

}  // namespace dkb
