// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/dynamics/mover_mask.h"

namespace dkb {

// A corner of the current image, with what flow and depth tell of it.
struct FilterFeature {
  Eigen::Vector2d image_pixel;     // [px] as read
  Eigen::Vector2d pixel;           // [px] ideal
  double depth = 0;                // [m] 0 = unknown
  bool flowed = false;             // the two below are known
  Eigen::Vector2d previous_pixel;  // [px] ideal, the same point in the previous image
  double previous_depth = 0;       // [m] there; 0 = unknown
};

// 1 = dynamic, per feature: those on marked cells.
std::vector<uint8_t> mask_filter(std::span<const FilterFeature> features, const MoverMask& mask);

}  // namespace dkb
