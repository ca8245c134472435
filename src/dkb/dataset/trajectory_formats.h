// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb/dataset/trajectory_file.h"
#include "dkb_slam/slam.h"

namespace dkb {

// KITTI's odometry format: a row `r11 r12 r13 tx r21 ... tz` of world_from_cam for each pose, without stamps.
std::string trajectory_to_kitti(const Trajectory& trajectory);

// The csv of the EuRoC data sets: `timestamp [ns],x,y,z,qw,qx,qy,qz`.
std::string trajectory_to_euroc(const Trajectory& trajectory);

// In the one of these formats, or TUM's. save_trajectory() of dkb_slam/slam.h writes it.
std::string trajectory_to_text(const Trajectory& trajectory, TrajectoryFormat format);

// Of this name: tum, kitti, euroc. Throws InputError that begins with `where`.
TrajectoryFormat trajectory_format_named(const std::string& name, const std::string& where);

}  // namespace dkb
