// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/geometry/decompositions.h"
#include "dkb/map/ids.h"
#include "dkb_slam/frame.h"

namespace dkb {

// How the camera moved since an earlier keyframe by what tells of it beside the map: depth from frame to frame, wheels,
// and that its velocity lasts.
struct KeyframeMotion {
  KeyframeId previous = kNoKeyframe;
  MotionPrior since;

  // The inverse covariance. Nobody knows a motion better than to a micrometre and a microradian, whatever is claimed.
  Matrix6d information() const {
    Matrix6d covariance = since.covariance;
    covariance.diagonal().array() += 1e-12 + 1e-11 * covariance.trace();
    return inverse(covariance);
  }
};

}  // namespace dkb
