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

// How uncertain the relative pose of two keyframes of a map is that share so many points, [translation m, rotation
// rad]: what tracking drifts over its length and turn, images of a turning camera being sheared. Keyframes that share
// many points hang together firmly.
Matrix6d edge_covariance(const Rigid3& b_from_a, int shared_points);

// The pose of a keyframe beside its parent, with which it shared so many points, as a motion.
MotionPrior ride_on(const Rigid3& cam_from_parent, int shared_points);

// Two keyframes that share so many points hang together as any others do.
inline constexpr int kEssentialSharedPoints = 100;

}  // namespace dkb
