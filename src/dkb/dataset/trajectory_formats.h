// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb/dataset/trajectory_file.h"

namespace dkb {

// KITTI's odometry format: a row `r11 r12 r13 tx r21 ... tz` of world_from_cam for each pose, without stamps.
std::string trajectory_to_kitti(const Trajectory& trajectory);

// The csv of the EuRoC data sets: `timestamp [ns],x,y,z,qw,qx,qy,qz`.
std::string trajectory_to_euroc(const Trajectory& trajectory);

}  // namespace dkb
