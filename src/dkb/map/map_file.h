// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "dkb/geometry/camera.h"
#include "dkb/map/map.h"

namespace dkb {

// What the numbers of a map mean: the camera that took it and the pyramid that its features were found on.
struct MapFileContext {
  CameraModel camera;
  double scale_factor = 1.2;  // size of a pyramid level over that of the next, (1, 4]
  int levels = 8;             // pyramid levels, 1 ... 32
  void check() const;         // throws InvalidOption
};

// Whether points fall on the same pixels of images of the same size.
bool same_optics(const CameraModel& a, const CameraModel& b);
// Throws InputError, which opens with `name` and says what to set, unless maps of both can be one.
void check_same_optics(const MapFileContext& of_map, const MapFileContext& wanted, const std::string& name);

struct MapFile {
  Map map;
  MapFileContext context;
};

// The map as bytes, complete and without loss: a map that was saved and loaded goes on exactly as the one that was
// saved. The bytes hold nothing of the machine, the time or the path: the same map gives the same bytes. The format is
// described in map_file.cpp. Throws std::logic_error for a map that no file can hold: values that are not finite, an
// octave beyond the context's levels, a point born at a keyframe that is not there.
std::string encode_map(const Map& map, const MapFileContext& context);

// Reads what encode_map() wrote. Every checksum, length, number and cross reference is checked before it is used.
// Throws InputError, which opens with `name`, for anything else.
MapFile decode_map(std::string_view bytes, const std::string& name);

// Replaces the file atomically. Throws OutputError.
void save_map(const std::filesystem::path& path, const Map& map, const MapFileContext& context);

// Throws InputError naming the file: unreadable, damaged, of a newer format, no map, one without keyframes.
MapFile load_map(const std::filesystem::path& path);

}  // namespace dkb
