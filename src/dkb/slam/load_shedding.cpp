// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/load_shedding.h"

#include <algorithm>
#include <utility>

namespace dkb {
namespace {

// In frames, since a queue of live frames is as long at every rate: 30 (PacedSource), of which the oldest is dropped.
constexpr int kLate = 5;     // behind, more than any single keyframe or correction costs
constexpr int kSettle = 5;   // in which it is seen whether the run catches up, also by what a step saves
constexpr int kOnTime = 60;  // in a row until a step is taken back: two seconds at 30 Hz

}  // namespace

// A frame is late by what the one before it was, and by as much as the time between the two exceeds that between
// their stamps.
void LoadShedding::begin(int64_t stamp_ns, int64_t now_ns) {
  if (stamp_ns_) {
    const int64_t interval = stamp_ns - *stamp_ns_;
    const bool waited = done_ns_ && now_ns - *done_ns_ > interval;
    late_ns_ = waited ? 0 : std::max<int64_t>(0, late_ns_ + (now_ns - *began_ns_) - interval);
    seconds_[level_] += 1e-9 * static_cast<double>(interval);
    choose(interval);
  }
  stamp_ns_ = stamp_ns;
  began_ns_ = now_ns;
  done_ns_.reset();
}

void LoadShedding::choose(int64_t interval_ns) {
  frames_on_time_ = late_ns_ <= interval_ns ? frames_on_time_ + 1 : 0;
  const auto step = [this](int by) {
    level_ = static_cast<Level>(level_ + by);
    frames_on_time_ = 0;
  };
  bool falls_behind = false;
  if (++frames_watched_ == kSettle) {
    // Late for a while already, and no less than it was: one wait for a detector that is loaded is made up for.
    falls_behind = late_ns_ > kLate * interval_ns && late_before_ns_ > interval_ns && late_ns_ >= late_before_ns_;
    frames_watched_ = 0;
    late_before_ns_ = late_ns_;
  }
  if (falls_behind && level_ + 1 < kLevels) {
    step(1);
    if (!std::exchange(warned_, true))
      warning_ =
          "the machine is too slow for this pace: until it has caught up, detection, then loop search, then features "
          "are cut";
  } else if (level_ > kFull && frames_on_time_ >= kOnTime) {
    step(-1);
  }
}

std::map<std::string, double> LoadShedding::seconds_by_name() const {
  const double features = seconds_[kFeatures], loops = seconds_[kLoops] + features;
  return {{"detection", seconds_[kDetection] + loops}, {"loop_search", loops}, {"features", features}};
}

std::string LoadShedding::take_warning() {
  return std::exchange(warning_, {});
}

}  // namespace dkb
