// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "dkb/map/ids.h"
#include "dkb/util/stamps.h"

namespace dkb {

// Turns durations into numbers of frames, which is what due times are counted in: a run must not depend on a clock.
class FrameRate {
 public:
  // `nominal` [1/s]: the camera's; 0 = as the first five stamps say. Until then 30.
  explicit FrameRate(double nominal) : rate_(nominal > 0 ? nominal : 30), known_(nominal > 0) {}

  void add(int64_t stamp_ns) {
    if (known_) return;
    stamps_.push_back(stamp_ns);
    known_ = stamps_.size() == 5;
    if (known_) rate_ = frame_rate_of(stamps_);
  }
  // The frames that cover so many seconds, at least one.
  FrameIndex frames(double seconds) const {
    return std::max(1, static_cast<FrameIndex>(std::ceil(seconds * rate_ - 1e-6)));
  }

 private:
  double rate_;
  bool known_;
  std::vector<int64_t> stamps_;
};

}  // namespace dkb
