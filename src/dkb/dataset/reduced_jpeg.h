// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb_slam/frame.h"

namespace dkb {

// The frame's picture, in colour where it has any, as a JPEG of the means of blocks of `factor` (1 ... 257) pixels a
// side; empty for a frame without one. What is left over at the right and at the bottom is not in it.
std::string reduced_jpeg(const Frame& frame, int factor, int quality);

}  // namespace dkb
