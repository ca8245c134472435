// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "dkb/mapping/local_bundle_adjustment.h"
#include "dkb/mapping/map_correction.h"
#include "dkb/matching/optics.h"

namespace dkb {

// The time of an adjustment grows faster than the pairs of keyframes that share points; each pair counts twice. At a
// quarter of this number it is some seconds, and a path of 200 m already misses keyframes (docs/benchmarks.md).
inline constexpr size_t kMostNeighbours = 160000;

// Adjusts the keyframes and points of a snapshot: those of the maps that keyframes `around` are in, or of all maps if
// there are none. The first keyframe of each map stays. Where these have more than `most_neighbours` covisible
// neighbours together, it takes what is nearest to `around`, else to the newest one, and what borders on the rest
// stays. `local` tells how points are weighted. Deterministic.
MapCorrection adjust_globally(const Map& map, const Optics& optics, const LocalBaOptions& local,
                              const std::vector<KeyframeId>& around = {}, size_t most_neighbours = kMostNeighbours);

}  // namespace dkb
