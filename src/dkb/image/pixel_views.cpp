// SPDX-License-Identifier: Apache-2.0
#include "dkb/image/pixel_views.h"

#include <cstring>
#include <vector>

#include "dkb/image/image.h"

namespace dkb {

ColourImage copy_colour(const ImageView& view) {
  const bool blue_first = view.format == PixelFormat::bgr8 || view.format == PixelFormat::bgra8;
  const int step = bytes_per_pixel(view.format);
  auto image = ColourImage::unfilled(view.width, view.height);
  for (int y = 0; y < view.height; ++y) {
    const uint8_t* in = view.row(y);
    Rgb* out = image.row(y);
    for (int x = 0; x < view.width; ++x, in += step)
      out[x] = blue_first ? Rgb{in[2], in[1], in[0]} : Rgb{in[0], in[1], in[2]};
  }
  return image;
}

GreyImage copy_grey(const ImageView& view) {
  auto image = GreyImage::unfilled(view.width, view.height);
  for (int y = 0; y < view.height; ++y) std::memcpy(image.row(y), view.row(y), view.row_bytes());
  return image;
}

DepthImage copy_depth(const ImageView& view, const Camera& camera) {
  auto image = DepthImage::unfilled(view.width, view.height);
  std::vector<uint16_t> units(view.format == PixelFormat::depth_u16 ? static_cast<size_t>(view.width) : 0);
  const auto width = static_cast<size_t>(view.width);
  for (int y = 0; y < view.height; ++y) {  // rows need not be aligned
    float* out = image.row(y);
    if (view.format == PixelFormat::depth_u16) {
      std::memcpy(units.data(), view.row(y), view.row_bytes());
      depth_from_units(units.data(), width, camera, out);
    } else {
      std::memcpy(out, view.row(y), view.row_bytes());
      depth_from_metres(out, width, camera, out);
    }
  }
  return image;
}

}  // namespace dkb
