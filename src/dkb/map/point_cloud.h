// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/map/map.h"

namespace dkb {

// The map points as a coloured cloud, by increasing point id, in the world [m]. The same map gives the same bytes.

// Stanford PLY, binary little-endian: x y z float, red green blue uchar, observations int (keyframes that see the
// point).
std::string point_cloud_ply(const Map& map);
// These alone, which must exist.
std::string point_cloud_ply(const Map& map, const std::vector<PointId>& points);

// Point Cloud Library's PCD 0.7, binary: x y z float, rgb as packed 0x00RRGGBB.
std::string point_cloud_pcd(const Map& map);

// JSON with all digits: points (id, position, colour 0-255, observations) and live keyframes (id, timestamp [s], and
// world_from_cam as position and quaternion_xyzw).
std::string point_cloud_json(const Map& map);

}  // namespace dkb
