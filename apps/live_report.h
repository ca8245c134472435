// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/source.h"

namespace dkb {

// What a camera's frames were like: their rate, how far apart colour and depth were taken, what was lost.
class LiveReport {
 public:
  void add(const SourceFrame& frame);
  // A line for people; empty when nothing came.
  std::string text(const SourceCounts& counts) const;

 private:
  std::vector<int64_t> skews_, intervals_;  // [ns]
  std::optional<int64_t> last_stamp_;       // nothing after a gap that is no fault of the rate
  int64_t skipped_ = 0, unplugged_ = 0;
};

}  // namespace dkb
