// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>

#include "dkb/map/map_file.h"

namespace dkb {

// Contents of a map file, section by section; see map_file.cpp for the format.
struct MapSections {
  static constexpr std::array<std::string_view, 5> kTags = {"HEAD", "KEYF", "DESC", "FEAT", "POIN"};
  std::array<std::string, 5> bytes;
};

// Throws std::logic_error for a map that no file can hold.
MapSections write_sections(const Map& map, const MapFileContext& context);

// Throws InputError, without a file name, when the sections are not those of a map.
MapFile read_sections(const std::array<std::string_view, 5>& sections);

// What is wrong with the numbers of a keyframe or a point; empty when nothing is.
std::string flaw_of(const Keyframe& keyframe, int levels);
std::string flaw_of(const MapPoint& point);

}  // namespace dkb
