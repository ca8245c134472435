// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/map.h"
#include "dkb/matching/optics.h"
#include "dkb/solver/bundle_adjustment.h"
#include "dkb/solver/geometric_weights.h"

namespace dkb {

struct LocalBaOptions {
  int free_keyframes = 12;   // the newest keyframe and its best covisible ones, >= 1
  int fixed_keyframes = 20;  // others that see their points, those with most first, >= 1
  bool weighted = true;      // geometric weights of DKB section 3.3 (switch BA of the paper's ablation)
  GeometricWeightOptions weights;
  bool planes = true;  // those that the map knows take part
};

// Adjusts the neighbourhood of a keyframe (DKB eqs. 42-48) and writes the result into the map; observations that end as
// outliers are forgotten. The oldest keyframe of the map never moves. Gives the points that moved, by increasing id.
std::vector<PointId> local_bundle_adjustment(Map& map, KeyframeId newest, const Optics& optics,
                                             const LocalBaOptions& options);

}  // namespace dkb
