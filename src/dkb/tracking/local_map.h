// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/map.h"
#include "dkb/matching/candidates.h"

namespace dkb {

struct LocalMapOptions {
  int voted_keyframes = 30;    // keyframes that share most points with the frame, >= 1
  int neighbours_of_each = 5;  // covisible keyframes added for each of them, >= 0
  int keyframes = 60;          // at most so many in all, >= 1
};

// The candidates around a frame that shows `points`: all points of the keyframes that see them and of their neighbours,
// by increasing id.
std::vector<Candidate> local_map_candidates(const std::vector<PointId>& points, const Map& map,
                                            const LocalMapOptions& options = {});

}  // namespace dkb
