// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace dkb {

// By the clock that LoadShedding is given.
inline int64_t steady_ns() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// How late a real-time run is, and what it leaves out to keep up with the camera. What is left out comes in a fixed
// order, a step at a time, and comes back once nothing is late any more. All times are given, by any steady clock.
class LoadShedding {
 public:
  enum Level {
    kFull,
    kDetection,  // the slow detector rests half of the time
    kLoops,      // and loop search and global adjustment wait until there is time
    kFeatures,   // and a frame gets fewer features
    kLevels
  };

  // A frame comes in.
  void begin(int64_t stamp_ns, int64_t now_ns);
  // It is done: who comes more than a frame later was not waiting for us, but we for the frame.
  void end(int64_t now_ns) { done_ns_ = now_ns; }

  Level level() const { return level_; }
  // [s] of the sequence so far without "detection", "loop_search" and "features", as Statistics has them.
  std::map<std::string, double> seconds_by_name() const;
  // What people should know, the first time that something is left out; else empty.
  std::string take_warning();

 private:
  void choose(int64_t interval_ns);

  std::optional<int64_t> stamp_ns_, began_ns_, done_ns_;  // of the frame before
  int64_t late_ns_ = 0, late_before_ns_ = 0;              // now; when it was looked at last
  Level level_ = kFull;
  int frames_watched_ = 0;                 // since then
  int frames_on_time_ = 0;                 // in a row
  std::array<double, kLevels> seconds_{};  // at each level
  bool warned_ = false;
  std::string warning_;
};

}  // namespace dkb
