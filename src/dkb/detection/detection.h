// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb_slam/detector.h"

namespace dkb {

// The part of `box` within an image of this size [px]; of zero width or height when there is none.
Box clip(const Box& box, int width, int height);

// Area of the intersection over area of the union, 0 ... 1; 0 for empty boxes.
float intersection_over_union(const Box& a, const Box& b);

}  // namespace dkb
