// SPDX-License-Identifier: Apache-2.0
#include "report/other_maps.h"

#include <numeric>
#include <system_error>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/map/map_suffix.h"
#include "dkb/util/plural.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace fs = std::filesystem;

std::string name_of_map(const std::string& name, size_t map, const std::string& ending) {
  return name + map_suffix(map) + ending;
}

size_t map_of_file(const std::string& file, const std::string& name, const std::string& ending) {
  constexpr int64_t kMost = 100000;  // maps; whoever reads the files makes room for them all
  const std::string start = name + "_map";
  int64_t number = 0;
  if (file.size() <= start.size() + ending.size() || !file.starts_with(start) || !file.ends_with(ending)) return 0;
  const std::string digits = file.substr(start.size(), file.size() - start.size() - ending.size());
  if (!parse_number(digits, &number) || number < 2 || number > kMost) return 0;
  const auto map = static_cast<size_t>(number - 1);
  return file == name_of_map(name, map, ending) ? map : 0;
}

std::string other_maps_text(const std::vector<size_t>& poses_of_map) {
  size_t poses = 0, maps = 0;
  std::string files;
  for (size_t map = 1; map < poses_of_map.size(); ++map) {
    if (poses_of_map[map] == 0) continue;
    ++maps;
    poses += poses_of_map[map];
    files += (files.empty() ? "" : ", ") + name_of_map("trajectory", map, ".txt");
  }
  if (maps == 0) return "";
  return (poses_of_map[0] == 0 ? "trajectory.txt holds no pose: " : "") + plural(poses, "frame is", "frames are") +
         " in " + plural(maps, "map that was", "maps that were") + " never joined" +
         (poses_of_map[0] == 0 ? " to the first: " : ": ") + files;
}

std::vector<size_t> poses_of_maps(const fs::path& results) {
  std::vector<size_t> poses(1, 0);
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(results, none)) {
    const std::string name = entry.path().filename().string();
    const size_t map = map_of_file(name, "trajectory", ".txt");
    if (map == 0 && name != "trajectory.txt") continue;
    if (poses.size() <= map) poses.resize(map + 1);
    poses[map] = read_trajectory(entry.path()).size();
  }
  return poses;
}

}  // namespace dkb
