// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
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

// Calls use(x, y) for each pixel of an image of this size whose place the box holds, row by row.
template <class Use>
void for_each_pixel(const Box& box, int width, int height, const Use& use) {
  const auto first = [](float begin, int size) {
    return static_cast<int>(std::clamp(std::ceil(begin), 0.0f, static_cast<float>(size)));
  };
  for (int y = first(box.y, height); y < height && static_cast<float>(y) < box.y + box.h; ++y)
    for (int x = first(box.x, width); x < width && static_cast<float>(x) < box.x + box.w; ++x) use(x, y);
}

// The number of the smallest box that holds a point [px], of equal ones the first; -1 where none does.
int smallest_box_at(std::span<const Detection> boxes, float x, float y);

// Of the intersection [px^2].
float shared_area(const Box& a, const Box& b);
// Area of the intersection over area of the union, 0 ... 1; 0 for empty boxes.
float intersection_over_union(const Box& a, const Box& b);

}  // namespace dkb
