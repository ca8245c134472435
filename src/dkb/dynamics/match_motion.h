// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>

#include "dkb/dynamics/mover_mask.h"
#include "dkb/image/image.h"

namespace dkb {

// Of a match with the map, where a frame's matches show two motions (solver/second_motion).
struct MatchMotion {
  Eigen::Vector2f image_pixel;
  float depth = 0;     // [m] > 0, of the map point
  bool moves = false;  // by the motion that is not the camera's
};

// The cells that hang together with a match that moves rather than with one of the room: by place_in_view, and no
// farther than one. `depth` [m] per cell of `cell` pixels; cells without are left out.
MoverMask moving_cells(const Image<float>& depth, int cell, std::span<const MatchMotion> matches);

}  // namespace dkb
