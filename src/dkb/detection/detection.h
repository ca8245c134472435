// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "dkb/util/errors.h"
#include "dkb_slam/detector.h"
#include "dkb_slam/errors.h"

namespace dkb {

// What a detector throws that can give no answer any more until it is reset.
class DetectorEnded : public InputError {
 public:
  using InputError::InputError;
};

// And one that never was: there is no such command. A run without it is not what was asked for.
class NeverStarted : public DetectorEnded {
 public:
  using DetectorEnded::DetectorEnded;
};

// The part of `box` within an image of this size [px]; of zero width or height when there is none.
Box clip(const Box& box, int width, int height);

// The number of the smallest box that holds a point [px], of equal ones the first; -1 where none does.
int smallest_box_at(std::span<const Detection> boxes, float x, float y);

// Of the intersection [px^2].
float shared_area(const Box& a, const Box& b);
// Area of the intersection over area of the union, 0 ... 1; 0 for empty boxes.
float intersection_over_union(const Box& a, const Box& b);

}  // namespace dkb
