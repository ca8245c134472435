// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace dkb {

// Owning, densely packed, row-major image. Pixel (x, y): x right, y down, (0, 0) is the centre of the top-left pixel.
template <class T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, T fill = T{})
      : width_(width), height_(height), data_(static_cast<size_t>(width) * static_cast<size_t>(height), fill) {}

  int width() const { return width_; }
  int height() const { return height_; }
  bool empty() const { return data_.empty(); }
  bool contains(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

  T* row(int y) { return data_.data() + static_cast<size_t>(y) * static_cast<size_t>(width_); }
  const T* row(int y) const { return data_.data() + static_cast<size_t>(y) * static_cast<size_t>(width_); }
  T& operator()(int x, int y) { return row(y)[x]; }
  const T& operator()(int x, int y) const { return row(y)[x]; }
  T* data() { return data_.data(); }
  const T* data() const { return data_.data(); }
  size_t size() const { return data_.size(); }
  bool operator==(const Image&) const = default;

 private:
  int width_ = 0, height_ = 0;
  std::vector<T> data_;
};

struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Rgb&) const = default;
};

using GreyImage = Image<uint8_t>;
using ColourImage = Image<Rgb>;
using DepthImage = Image<float>;  // [m] along the optical axis, 0 = no data

// Luma of an sRGB image (ITU-R BT.601 weights in 14-bit fixed point, rounded).
GreyImage grey_from_colour(const ColourImage& colour);

}  // namespace dkb
