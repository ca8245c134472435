// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "dkb/map/map.h"
#include "dkb/matching/optics.h"
#include "dkb/solver/bundle_adjustment.h"

namespace dkb {

// A part of a map as bundle adjustment wants it, and the names of what stands where in it.
struct BaWindow {
  BaProblem problem;
  std::vector<KeyframeId> keyframes;  // per camera of the problem, before the poses of planes
  std::vector<PointId> points;        // per point

  // What observation `o` of the problem is of.
  PointId point_of(size_t o) const { return points[static_cast<size_t>(problem.observations[o].point)]; }
  KeyframeId keyframe_of(size_t o) const { return keyframes[static_cast<size_t>(problem.observations[o].camera)]; }
  int camera_of(KeyframeId keyframe) const {  // must be in it
    return static_cast<int>(std::find(keyframes.begin(), keyframes.end(), keyframe) - keyframes.begin());
  }
};

// `keyframes` with their observations of `points`; all must be live. `fixed`: per keyframe, 1 = stays where it is.
// `planes`: with what they see of planes.
BaWindow make_ba_window(const Map& map, std::vector<KeyframeId> keyframes, std::vector<uint8_t> fixed,
                        std::vector<PointId> points, const Optics& optics, bool planes);

}  // namespace dkb
