// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "dkb/map/map_file.h"

namespace dkb {

// A map as others take it who make pictures of it: photogrammetry, neural radiance fields, Gaussian splatting. Of one
// map alone, since maps that were never joined have worlds of their own.

// Name of a keyframe's picture, without folder: STAMP.png.
std::string picture_name(const Keyframe& keyframe);
// The live keyframes of the map that has most of them, increasing.
std::vector<KeyframeId> keyframes_of_largest_map(const Map& map);

// COLMAP's text model of some of these keyframes: sparse/0/cameras.txt, images.txt and points3D.txt with their tracks,
// below `folder`. Pixels have their origin at the corner of the top-left pixel there.
void write_colmap(const MapFile& file, const std::vector<KeyframeId>& keyframes, const std::filesystem::path& folder);

// nerfstudio's transforms.json of them and sparse_pc.ply of what they show, below `folder`. Poses are world_from_cam
// with the axes of OpenGL: x right, y up, z backward. `has_masks`: masks/STAMP.png lie beside the pictures.
void write_nerfstudio(const MapFile& file, const std::vector<KeyframeId>& keyframes, bool has_masks,
                      const std::filesystem::path& folder);

}  // namespace dkb
