// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/map.h"
#include "dkb/matching/optics.h"

namespace dkb {

// Makes points from features of `newest` that show none yet, by matching them along epipolar lines in covisible
// keyframes and triangulating. The ids of the new points, increasing.
std::vector<PointId> triangulate_new_points(Map& map, KeyframeId newest, const Optics& optics);

}  // namespace dkb
