// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>

#include "dkb/detection/detection.h"

namespace dkb {

// Something that moves by itself, as seen in one frame: an obstacle for a planner.
struct Mover {
  int id = 0;                                  // the same in all frames of one run, from 1
  std::string class_name;                      // the detector's; "object" when no detector knows it
  Eigen::Vector3d position_in_world{0, 0, 0};  // [m] median of its visible surface points, per coordinate
  Eigen::Vector3d velocity_in_world{0, 0, 0};  // [m/s]
  double position_sd = 0;                      // [m] standard deviation of each coordinate of the position
  Box box;                                     // [px] of the original image
  bool operator==(const Mover&) const = default;
};

}  // namespace dkb
