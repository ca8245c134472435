// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "dkb/util/quantile.h"

namespace dkb {

// Tells once when stamps are of another unit than nanoseconds.
class StampDoubt {
 public:
  // `nominal` [1/s]: the camera's; 0 = unknown.
  explicit StampDoubt(double nominal) : told_(nominal > 0), rate_(told_ ? nominal : 30) {}

  // What speaks against the stamps, or nothing.
  std::string add(int64_t stamp_ns) {
    constexpr size_t kIntervals = 30;
    // Units are a thousand apart: this is far from one, and further than frames that were lost or slowed down lead.
    constexpr double kOff = 100;
    if (intervals_.size() == kIntervals) return "";
    if (last_) intervals_.push_back(seconds(*last_, stamp_ns));
    last_ = stamp_ns;
    if (intervals_.size() < kIntervals) return "";
    std::vector<double> sorted = intervals_;
    const double median = upper_median(sorted), off = median * rate_;
    if (off > 1 / kOff && off < kOff) return "";
    std::ostringstream text;
    text << std::setprecision(2) << "the stamps of the first frames are " << median << " s apart in the median, and "
         << (told_ ? "the camera gives " : "cameras give about ") << rate_
         << " frames a second; stamps must be in nanoseconds";
    return text.str();
  }

 private:
  static double seconds(int64_t from_ns, int64_t to_ns) {  // they rise, by how much ever
    return 1e-9 * static_cast<double>(static_cast<uint64_t>(to_ns) - static_cast<uint64_t>(from_ns));
  }

  bool told_;
  double rate_;
  std::optional<int64_t> last_;
  std::vector<double> intervals_;  // [s]
};

}  // namespace dkb
