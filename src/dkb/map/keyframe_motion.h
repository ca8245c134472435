// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/map/ids.h"
#include "dkb_slam/frame.h"

namespace dkb {

// How the camera moved since an earlier keyframe by what tells of it beside the map: depth from frame to frame, wheels,
// and that its velocity lasts.
struct KeyframeMotion {
  KeyframeId previous = kNoKeyframe;
  MotionPrior since;
};

}  // namespace dkb
