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

struct CarryOptions {
  int min_points = 4;            // followed points inside a box below which it is not moved, only grown; >= 1
  float max_scale_step = 1.05f;  // largest change of size per frame carried, either way; >= 1
  float growth_px = 1.0f;        // [px] per frame and side, for what flow does not tell; >= 0
  float blind_growth = 0.02f;    // share of the box per frame and side, more, for boxes without enough points; >= 0
};

// Where the objects of `from` are `frames` frames later: every box is moved by the median motion of the points inside
// it, scaled by the median change of the distances to the points' centre, grown by the uncertainty, and clipped to the
// image (width x height [px]). Boxes that left the image are dropped. Where boxes overlap, a point counts for the
// smallest box that holds it, and for the others only when these have too few of their own. The mask, if any, moves
// with its boxes; what lies in no box stays. `kept`, if any, gets the number in `from` of each box that is left. Pure
// and deterministic; classes and scores are kept.
Detections carry(const Detections& from, std::span<const PointMotion> motions, int frames, int width, int height,
                 const CarryOptions& options = {}, std::vector<size_t>* kept = nullptr);

}  // namespace dkb
