// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include "dkb/util/timing.h"
#include "dkb_slam/frame.h"

namespace dkb {

// How a run is getting on, on standard error: one line that renews itself on a terminal; plain lines now and then
// elsewhere.
class Progress {
 public:
  // `total`: about how many frames there are.
  Progress(std::optional<size_t> total, bool quiet);
  void frame(size_t done, const FrameResult* result);
  void finish();

 private:
  std::optional<size_t> total_;
  bool quiet_, terminal_, open_line_ = false;
  double last_ms_ = -1e9;
  Stopwatch watch_;
};

}  // namespace dkb
