// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/map.h"
#include "dkb/matching/optics.h"

namespace dkb {

struct PointCreationOptions {
  int neighbours = 6;             // covisible keyframes to triangulate with, >= 0 (0 = depth alone makes points)
  double min_parallax_deg = 1.0;  // [deg] between the rays of a new point, > 0
};

// Makes points from features of `newest` that show none yet, by matching them along epipolar lines in covisible
// keyframes and triangulating. The ids of the new points, increasing.
std::vector<PointId> triangulate_new_points(Map& map, KeyframeId newest, const Optics& optics,
                                            const PointCreationOptions& options = {});

}  // namespace dkb
