// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "dkb/geometry/rigid3.h"

namespace dkb {

struct TrajectoryFrame;

struct StampedPose {
  double timestamp = 0;   // [s]
  std::string stamp;      // as read, or as it shall be written; empty: written from `timestamp` with 6 decimals
  Rigid3 world_from_cam;  // [m], unit quaternion
};
using Trajectory = std::vector<StampedPose>;  // stamps not falling

// TUM format, `stamp tx ty tz qx qy qz qw` (camera in world). Comments, blank lines and CRLF are fine; rows are sorted
// by stamp, equal stamps stay in the file's order; quaternions are normalised. Throws InputError with file:line for
// rows of other than 8 columns, values that are not finite and quaternions whose length is more than 1e-2 off 1. An
// empty file gives an empty trajectory.
Trajectory read_trajectory(const std::filesystem::path& path);
// With `hidden` the file is a truth: rows with `nan`, which motion capture writes where its markers are hidden, are
// left out and counted.
Trajectory parse_trajectory(const std::string& text, const std::string& name, size_t* hidden = nullptr);
Trajectory read_truth(const std::filesystem::path& path, size_t* hidden = nullptr);
std::string hidden_text(size_t rows);  // how many were left out, for people

// groundtruth.txt of a recording's folder, by read_truth(); none where it has no such file.
std::optional<Trajectory> truth_beside(const std::filesystem::path& recording, size_t* hidden = nullptr);

// TUM format with `#` header, 9 decimals, w of the quaternion not negative. Rows in the order given.
std::string trajectory_to_text(const Trajectory& trajectory);
// Written atomically. Throws as write_file_atomically() does.
void write_trajectory(const std::filesystem::path& path, const Trajectory& trajectory);

// What Slam says of a trajectory, as files have it: one trajectory a map, the first in any case, rows by stamp.
// `stamps`: the stamp of every frame, as it shall be written; empty: by its nanoseconds. Keyframes of a loaded map are
// of no frame.
std::vector<Trajectory> trajectories_by_map(const std::vector<TrajectoryFrame>& frames,
                                            const std::vector<std::string>& stamps);

}  // namespace dkb
