// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/loop/loop_detector.h"
#include "dkb/mapping/map_correction.h"

namespace dkb {

// How the map ought to move so that the loop closes: a pose graph over the essential graph (spanning tree, strong
// covisibility, seams of earlier loops) and the loop. All but the loop is taken from the map as it is. Where two maps
// meet, the younger one moves as one piece onto the older one. Deterministic.
MapCorrection correct_loop(const Map& map, const LoopFinding& finding);

}  // namespace dkb
