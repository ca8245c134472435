// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "dkb/detection/detection.h"

namespace dkb {

// A point followed from the frame of the detections to the current one [px].
struct PointMotion {
  Eigen::Vector2f from, to;
};

// Where the objects of `from` are `frames` frames later: every box is moved by the median motion of the points inside
// it, scaled by the median change of the distances to the points' centre, grown by the uncertainty, and clipped to the
// image (width x height [px]). Boxes that left the image are dropped. Where boxes overlap, a point counts for the
// smallest box that holds it, and for the others only when these have too few of their own. The mask, if any, moves
// with its boxes; what lies in no box stays. `kept`, if any, gets the number in `from` of each box that is left. Pure
// and deterministic; classes and scores are kept.
Detections carry(const Detections& from, std::span<const PointMotion> motions, int frames, int width, int height,
                 std::vector<size_t>* kept = nullptr);

}  // namespace dkb
