// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/image/image.h"

namespace dkb {

// Marks in `into` what `other` marks; an empty `into` takes its shape. Cells of `other` may be of another size.
void unite(MoverMask& into, const MoverMask& other, int width, int height);

// Grows the marked area by `radius` cells in all eight directions.
void dilate(MoverMask& mask, int radius);
// Shrinks it likewise; what lies outside the image counts as marked.
void erode(MoverMask& mask, int radius);

// `mask`, spread from where it has depth into what lacks depth and hangs together with it, over `max_distance` [m] of
// image at that depth; `focal` [px]. Black parts of movers have no depth, nor has the background right beside a mover.
MoverMask spread_into_holes(const MoverMask& mask, const DepthImage& depth, double max_distance, double focal);

}  // namespace dkb
