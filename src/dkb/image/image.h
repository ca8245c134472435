// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb_slam/geometry.h"
#include "dkb_slam/image.h"

namespace dkb {

// Luma of an sRGB image (ITU-R BT.601 weights in 14-bit fixed point, rounded).
GreyImage grey_from_colour(const ColourImage& colour);

// Depths as the library wants them: metres, the float nearest to units / depth_factor, and 0 where there is none within
// the camera's range. Whatever way images come in, they pass here.
void depth_from_units(const uint16_t* units, size_t count, const Camera& camera, float* metres);
void depth_from_metres(const float* in, size_t count, const Camera& camera, float* metres);
// The camera's mask, if any, has no depth.
void leave_out_masked(const Camera& camera, DepthImage& depth);

}  // namespace dkb
