// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/map/ids.h"

namespace dkb {

// Keyframes whose ids are nearer to each other make no loop.
inline constexpr KeyframeId kMinKeyframesBetween = 10;

struct LoopOptions {
  bool enabled = true;
  int min_inliers = 50;  // map points that the refined pose rests on, >= 10
  int min_support = 2;   // keyframes around the newest one that must show the area just there as well, >= 0
};

}  // namespace dkb
