// SPDX-License-Identifier: Apache-2.0
#include "report/other_maps.h"

#include <gtest/gtest.h>

#include "dkb/util/files.h"
#include "dkb/util/test_folder.h"

namespace dkb {
namespace {

TEST(OtherMaps, NamesAreReadAsTheyAreWritten) {
  for (const size_t map : {1U, 9U, 99'999U})
    EXPECT_EQ(map_of_file(name_of_map("map", map, ".ply"), "map", ".ply"), map);
  for (const char* name : {"map.ply", "map_map1.ply", "map_map0.ply", "map_map02.ply", "map_map.ply", "map_map2.txt",
                           "map_map100001.ply", "map_map99999999999.ply", "map_map-2.ply"})
    EXPECT_EQ(map_of_file(name, "map", ".ply"), 0U) << name;
}

TEST(OtherMaps, FilesOfSomebodyElsesAreNotCounted) {
  const test::TempFolder temp;
  const std::string row = "1 0 0 0 0 0 0 1\n";
  write_file_atomically(temp / "trajectory.txt", row + row);
  write_file_atomically(temp / "trajectory_map3.txt", row);
  for (const char* name : {"trajectory_map03.txt", "trajectory_map99999999999.txt", "trajectory_map_mine.txt"})
    write_file_atomically(temp / name, row);
  EXPECT_EQ(poses_of_maps(temp / ""), (std::vector<size_t>{2, 0, 1}));
}

}  // namespace
}  // namespace dkb
