// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb_slam/geometry.h"
#include "dkb_slam/image.h"

namespace dkb {

// Copies of somebody else's pixels, as the library wants them. The views must be sound and of a format that fits.
ColourImage copy_colour(const ImageView& view);
GreyImage copy_grey(const ImageView& view);
// By depth_from_units() and depth_from_metres().
DepthImage copy_depth(const ImageView& view, const Camera& camera);

}  // namespace dkb
