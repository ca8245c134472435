// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "dkb_slam/frame.h"

namespace dkb {

// One row of movers.csv.
struct MoverRow {
  double timestamp = 0;  // [s] of the colour image
  std::string stamp;     // the same as read from the dataset
  Mover mover;
  bool operator==(const MoverRow&) const = default;
};
using MoverRows = std::vector<MoverRow>;  // by time; within a frame in the file's order

// movers.csv: a header line `timestamp,id,class,x,y,z,vx,vy,vz,position_sd,box_x,box_y,box_w,box_h,velocity_sd`, then
// one line per mover and frame: position [m] and velocity [m/s] in the world with the standard deviations of their
// coordinates, box [px] with its top-left corner. Metres are written with 4 decimals, pixels with 2. Commas, quotes and
// white space in class names become '_'; an empty class, "object".
double velocity_sd(const Mover& mover);  // [m/s] of each coordinate, as the file has it
std::string movers_to_csv(const MoverRows& rows);
std::string written_class(std::string class_name);  // in one word, as it stands there

// The same format; the last column may be missing, as in files of 0.2.0 and of the simulator. CRLF, a byte order mark
// and empty lines are tolerated. Throws InputError `name:line: ...` for another header, another number of columns,
// numbers that are not finite, ids below 1 or twice in a frame, a negative position_sd or box size, an empty class, and
// stamps that go back.
MoverRows parse_movers(std::string_view text, const std::string& name);
MoverRows read_movers(const std::filesystem::path& path);

}  // namespace dkb
