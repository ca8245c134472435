// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "dkb/map/byte_stream.h"
#include "dkb/map/map_file.h"

namespace dkb {

// Contents of a map file, section by section; see map_file.cpp for the format.
struct MapSections {
  static constexpr size_t kCount = 7, kOfFormat1 = 5;
  static constexpr std::array<std::string_view, kCount> kTags = {"HEAD", "KEYF", "DESC", "FEAT",
                                                                 "POIN", "MOTN", "PLAN"};
  std::array<std::string, kCount> bytes;
};

// Throws std::logic_error for a map that no file can hold.
MapSections write_sections(const Map& map, const MapFileContext& context);

// Throws InputError, without a file name, when the sections are not those of a map of this format. Format 1 has none of
// the last two: they are empty then.
MapFile read_sections(const std::array<std::string_view, MapSections::kCount>& sections, uint32_t format);

bool sound(const Rigid3& pose);                    // finite, its quaternion of unit norm
bool is_near_image(const Eigen::Vector2f& pixel);  // as can be turned into an integer
void write_pose(ByteWriter& out, const Rigid3& pose);
Rigid3 read_pose(ByteReader& in);

// What holds keyframes together beside points. Motions and planes with numbers that cannot be are left out.
std::string motion_section(const Map& map);
void read_motion_section(std::string_view bytes, std::vector<Keyframe>& keyframes);
std::string plane_section(const Map& map, const CameraModel& camera);
void read_plane_section(std::string_view bytes, const CameraModel& camera, std::vector<Keyframe>& keyframes);

// What is wrong with the numbers of a keyframe or a point; empty when nothing is.
std::string flaw_of(const Keyframe& keyframe, int levels);
std::string flaw_of(const MapPoint& point);

}  // namespace dkb
