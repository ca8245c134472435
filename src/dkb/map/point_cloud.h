// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/map/map.h"

namespace dkb {

// Map points as a coloured cloud, in the world [m]. The same points give the same bytes.

// The live points of each map that is not joined, by its number and then by increasing id: their worlds are not one.
std::vector<std::vector<PointId>> points_by_map(const Map& map);

// Stanford PLY, binary little-endian: x y z float, red green blue uchar, observations int (keyframes that see the
// point). The points must exist, here and below.
std::string point_cloud_ply(const Map& map, const std::vector<PointId>& points);

// Point Cloud Library's PCD 0.7, binary: x y z float, rgb as packed 0x00RRGGBB.
std::string point_cloud_pcd(const Map& map, const std::vector<PointId>& points);

// JSON with all digits of all maps: points (id, map, position, colour 0-255, observations) and live keyframes (id, map,
// timestamp [s], and world_from_cam as position and quaternion_xyzw). `map` is a number from 0: each has a world.
std::string point_cloud_json(const Map& map);

}  // namespace dkb
