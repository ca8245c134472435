// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "dkb/map/map_file.h"
#include "dkb_slam/slam.h"
#include "dkb_slam/source.h"

namespace dkb {

// How a mask beside images/STAMP.png is called: nerfstudio's masks/STAMP.png, or COLMAP's masks/STAMP.png.png.
enum class MaskNames { as_picture, with_ending };

// Plays the source once more in the map, without changing it, and writes of each keyframe of the largest map the
// picture as images/STAMP.png and what may move in it as masks/: 0 = mover, 255 = the still world. Returns the
// keyframes that the source has, increasing; throws InputError when it has none.
std::vector<KeyframeId> write_keyframe_pictures(const MapFile& file, Source& source, Slam& slam, MaskNames names,
                                                const std::filesystem::path& folder);

}  // namespace dkb
