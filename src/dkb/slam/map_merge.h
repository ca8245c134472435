// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "dkb/map/map.h"
#include "dkb/matching/optics.h"
#include "dkb/slam/options.h"

namespace dkb {

struct MergedMaps {
  Map map;         // in the world of the first; keyframes of the second follow those of the first
  int merges = 0;  // joints by which parts that were not connected became one
  int loops = 0;   // places seen by both, or twice by the second, that were closed besides
};

// Joins `second` to `first` where they show the same place: place recognition, geometric verification, consistency over
// several keyframes, fusion of the points that are the same, and at last an adjustment of the whole. Both must be taken
// by the same camera and pyramid (`optics`). Nothing when no place is found that both show. Deterministic.
std::optional<MergedMaps> merge_maps(const Map& first, const Map& second, const Optics& optics,
                                     const SlamOptions& options);

}  // namespace dkb
