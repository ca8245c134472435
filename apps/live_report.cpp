// SPDX-License-Identifier: Apache-2.0
#include "live_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "dkb/util/quantile.h"

namespace dkb {

void LiveReport::add(const SourceFrame& frame) {
  if (frame.state == SourceState::skipped) ++skipped_;
  if (frame.state == SourceState::unplugged) ++unplugged_, last_stamp_.reset();
  if (frame.state != SourceState::frame) return;
  const int64_t stamp = frame.frame.stamp_ns();
  skews_.push_back(std::abs(frame.frame.depth_stamp_ns() - stamp));
  if (last_stamp_) intervals_.push_back(stamp - *last_stamp_);
  last_stamp_ = stamp;
}

std::string LiveReport::text(const SourceCounts& counts) const {
  if (skews_.empty()) return "";
  std::vector<int64_t> skews = skews_, intervals = intervals_;
  const auto ms = [](int64_t ns) { return static_cast<double>(ns) / 1e6; };
  std::string line = fmt::format("{} frames, depth {:.1f} ms from colour in the median, {:.1f} at most", skews.size(),
                                 ms(upper_median(skews)), ms(*std::max_element(skews.begin(), skews.end())));
  if (!intervals.empty()) {
    const double usual = static_cast<double>(std::max<int64_t>(upper_median(intervals), 1));
    int64_t missing = 0;
    for (const int64_t interval : intervals_)
      missing += std::max<int64_t>(0, std::llround(static_cast<double>(interval) / usual) - 1);
    missing = std::max<int64_t>(0, missing - counts.dropped);
    line += fmt::format("; {:.1f} frames/s, {} missing by that rate", 1e9 / usual, missing);
  }
  line += fmt::format("; {} dropped because we were too slow, {} images unpaired, {} late or repeated", counts.dropped,
                      counts.unpaired, counts.late);
  if (skipped_ > 0) line += fmt::format("; {} broken", skipped_);
  if (unplugged_ > 0) line += fmt::format("; unplugged {} time{}", unplugged_, unplugged_ == 1 ? "" : "s");
  return line;
}

}  // namespace dkb
