// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "dkb/util/quantile.h"

namespace dkb {

// Tells once when stamps are of another unit than nanoseconds, and whenever one leaps far ahead, since whatever comes
// before it is refused from then on.
class StampDoubt {
 public:
  // `nominal` [1/s]: the camera's; 0 = unknown.
  explicit StampDoubt(double nominal) : told_(nominal > 0), rate_(told_ ? nominal : 30) {}

  // What speaks against the stamps, or nothing.
  std::string add(int64_t stamp_ns) {
    constexpr size_t kIntervals = 30;
    if (!last_) {
      last_ = stamp_ns;
      return "";
    }
    const double interval = seconds(*last_, stamp_ns);
    const double before = std::exchange(interval_, interval);
    last_ = stamp_ns;
    if (intervals_.size() == kIntervals) return leap(interval, before);
    intervals_.push_back(interval);
    if (intervals_.size() < kIntervals) return leap(interval, before);
    std::vector<double> sorted = intervals_;
    const double median = upper_median(sorted), off = median * rate_;
    if (off > 1 / kOff && off < kOff) return leap(interval, before);
    std::ostringstream text;
    text << std::setprecision(2) << "the stamps of the first frames are " << median << " s apart in the median, and "
         << (told_ ? "the camera gives " : "cameras give about ") << rate_
         << " frames a second; stamps must be in nanoseconds, those of a folder's lists in seconds";
    return text.str();
  }

  // Frames came that nobody looked at: the time until the next one is no interval.
  void pass_over() { last_.reset(), interval_ = 0; }

 private:
  // Where it is no matter of all stamps: the one before was in time.
  std::string leap(double interval, double before) const {
    if (interval * rate_ < kOff || before <= 0 || interval < kOff * before) return "";
    std::ostringstream text;
    text << std::setprecision(3) << "the stamp is " << interval
         << " s after the one before it; if the clock leapt, call reset(): frames with earlier stamps are refused";
    return text.str();
  }
  static double seconds(int64_t from_ns, int64_t to_ns) {  // they rise, by how much ever
    return 1e-9 * static_cast<double>(static_cast<uint64_t>(to_ns) - static_cast<uint64_t>(from_ns));
  }

  // Units are a thousand apart: this is far from one, and further than frames that were lost or slowed down lead.
  static constexpr double kOff = 100;

  bool told_;
  double rate_;
  std::optional<int64_t> last_;
  double interval_ = 0;            // [s] up to it
  std::vector<double> intervals_;  // [s]
};

}  // namespace dkb
