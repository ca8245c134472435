// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace dkb {

// Maps that were never joined to the first have worlds, and files, of their own: NAME.txt, NAME_map2.txt and so on.
std::string name_of_map(const std::string& name, size_t map, const std::string& ending);
// The number of NAME's map that a file there is of, by a name as name_of_map() gives it; 0 where it is of none but the
// first.
size_t map_of_file(const std::string& file, const std::string& name, const std::string& ending);

// "50 frames are in 1 map that was never joined: trajectory_map2.txt", by how many poses each map has; empty where all
// are in the first.
std::string other_maps_text(const std::vector<size_t>& poses_of_map);
// The same by the files that lie beside trajectory.txt.
std::vector<size_t> poses_of_maps(const std::filesystem::path& results);

}  // namespace dkb
