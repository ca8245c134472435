// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <optional>
#include <vector>

#include "dkb/loop/loop_options.h"
#include "dkb/map/map.h"
#include "dkb/matching/place_fit.h"

namespace dkb {

// A place seen again: the newest keyframe and its supporting keyframes show the area around an old one.
struct LoopFinding {
  struct Support {
    KeyframeId keyframe = kNoKeyframe;
    PlaceFit fit;  // in the old place's part of the world
  };
  std::vector<Support> support;      // the newest keyframe first
  std::vector<KeyframeId> far_area;  // the old keyframe first
  bool merge = false;                // the two belong to maps that are not joined
};

// The shortest path from one keyframe to another, along covisibility and the spanning tree.
struct PathThroughMap {
  double length = std::numeric_limits<double>::infinity();  // [m]; infinite where there is none
  // [m^2, rad^2] in all axes together, of the motions that it takes where no points tie keyframes together.
  double position_variance = 0, rotation_variance = 0;
};
// From `from` to every keyframe, or as far as to those of `to`: it ends when each of them is reached. What it tells of
// others is no less than it should be.
std::vector<PathThroughMap> paths_through_map(const Map& map, KeyframeId from, const std::vector<KeyframeId>& to = {});

// The most that a way may be off by.
struct DriftBound {
  double translation = 0;  // [m]
  double rotation = 0;     // [deg]
};
DriftBound drift_bound(const PathThroughMap& path);

// Does keyframe `id` show a place that the map knows, but does not know to be the same? Candidates are the keyframes
// that look most like it (PlaceIndex), its neighbours apart. Each is verified as a camera that was lost is found: a
// pose by descriptors alone, matches around it, and a pose on these. A loop needs supporting keyframes, and a drift
// that the path between the two places could explain. Only the path tells similar rooms apart: their views pass the
// other tests as well as those of one room do.
//
// A pure function of the snapshot. Deterministic for a seed.
std::optional<LoopFinding> find_loop(const Map& map, KeyframeId id, const Optics& optics, const LoopOptions& options,
                                     uint64_t seed);

}  // namespace dkb
