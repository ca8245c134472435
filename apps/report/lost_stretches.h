// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "report/run_log.h"

namespace dkb::report {

// Consecutive frames that have no pose for the same reason.
struct LostPart {
  size_t begin = 0, end = 0;  // rows, the end not included
  std::string cause;          // "no features", ...: one of a few
  std::string evidence;       // the numbers that say so
};

// Consecutive frames of which the images told no pose.
struct LostStretch {
  size_t begin = 0, end = 0;                  // rows, the end not included
  TrackingState state = TrackingState::lost;  // lost, initialising, or predicted: a motion prior bridged it
  std::vector<LostPart> parts;                // of all its frames, at least one
};

struct CauseLimits {
  int min_inliers = 20;      // Options::tracking
  int initial_points = 100;  // likewise
  double focal = 525;        // [px]
  int image_width = 640;     // [px]
};

// Every such stretch with its likely causes: what begins one is not what keeps the camera from being found again.
std::vector<LostStretch> lost_stretches(const std::vector<FrameRow>& rows, const CauseLimits& limits);

}  // namespace dkb::report
