// SPDX-License-Identifier: Apache-2.0
#include "dkb/image/image.h"

namespace dkb {

GreyImage grey_from_colour(const ColourImage& colour) {
  GreyImage grey(colour.width(), colour.height());
  const Rgb* in = colour.data();
  uint8_t* out = grey.data();
  const size_t n = colour.size();
  for (size_t i = 0; i < n; ++i)
    out[i] = static_cast<uint8_t>((4899u * in[i].r + 9617u * in[i].g + 1868u * in[i].b + 8192u) >> 14);
  return grey;
}

void depth_from_units(const uint16_t* units, size_t count, const Camera& camera, float* metres) {
  const auto factor = static_cast<float>(camera.depth_factor);
  if (static_cast<double>(factor) == camera.depth_factor)  // one rounding, that of the division
    for (size_t i = 0; i < count; ++i) metres[i] = static_cast<float>(units[i]) / factor;
  else
    for (size_t i = 0; i < count; ++i)
      metres[i] = static_cast<float>(static_cast<double>(units[i]) / camera.depth_factor);
  depth_from_metres(metres, count, camera, metres);
}

void depth_from_metres(const float* in, size_t count, const Camera& camera, float* metres) {
  const auto low = static_cast<float>(camera.depth_min), high = static_cast<float>(camera.depth_max);
  for (size_t i = 0; i < count; ++i) metres[i] = in[i] >= low && in[i] <= high ? in[i] : 0.0f;  // false for NaN
}

}  // namespace dkb
