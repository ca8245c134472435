// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/loop/loop_detector.h"
#include "dkb/mapping/map_correction.h"

namespace dkb {

// Measured motion between two keyframes that a loop joined.
struct LoopEdge {
  KeyframeId a = kNoKeyframe, b = kNoKeyframe;
  Rigid3 b_from_a;
  int shared_points = 0;
};

// The edges that a finding adds: from the old keyframe to each that saw it again.
std::vector<LoopEdge> loop_edges(const Map& map, const LoopFinding& finding);

// How the map ought to move so that the loop closes: a pose graph over the essential graph (spanning tree, strong
// covisibility, loops so far and now). Where two maps meet, the younger one moves as one piece onto the older one.
// `edges`: those of earlier loops and merges, to which its own are added. Deterministic.
MapCorrection correct_loop(const Map& map, const LoopFinding& finding, std::vector<LoopEdge>* edges);

}  // namespace dkb
