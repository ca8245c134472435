// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/map/map.h"
#include "dkb/matching/candidates.h"

namespace dkb {

// The candidates around a frame that shows `points`: all points of the keyframes that see most of them and of the
// neighbours of these, by increasing id.
std::vector<Candidate> local_map_candidates(const std::vector<PointId>& points, const Map& map);

}  // namespace dkb
