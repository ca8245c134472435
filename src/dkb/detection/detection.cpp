// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detection.h"

#include <algorithm>

namespace dkb {

Box clip(const Box& box, int width, int height) {
  const float left = std::clamp(box.x, 0.0f, static_cast<float>(width));
  const float top = std::clamp(box.y, 0.0f, static_cast<float>(height));
  const float right = std::clamp(box.x + box.w, left, static_cast<float>(std::max(width, 0)));
  const float bottom = std::clamp(box.y + box.h, top, static_cast<float>(std::max(height, 0)));
  return {left, top, right - left, bottom - top};
}

int smallest_box_at(std::span<const Detection> boxes, float x, float y) {
  int smallest = -1;
  for (size_t b = 0; b < boxes.size(); ++b)
    if (boxes[b].box.contains(x, y) &&
        (smallest < 0 || boxes[b].box.area() < boxes[static_cast<size_t>(smallest)].box.area()))
      smallest = static_cast<int>(b);
  return smallest;
}

float shared_area(const Box& a, const Box& b) {
  const float w = std::min(a.x + a.w, b.x + b.w) - std::max(a.x, b.x);
  const float h = std::min(a.y + a.h, b.y + b.h) - std::max(a.y, b.y);
  return w > 0 && h > 0 ? w * h : 0;
}

float intersection_over_union(const Box& a, const Box& b) {
  const float both = shared_area(a, b), either = a.area() + b.area() - both;
  return either > 0 ? std::min(1.0f, both / either) : 0.0f;
}

}  // namespace dkb
