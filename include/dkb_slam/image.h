// SPDX-License-Identifier: Apache-2.0
/// \file
/// Images: views of the caller's memory, and images that own theirs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "dkb_slam/version.h"

namespace dkb {

/// How a pixel is stored. Depth is along the optical axis; 0 and values that are not finite mean no data.
enum class PixelFormat {
  rgb8,       ///< 3 bytes
  bgr8,       ///< 3 bytes
  rgba8,      ///< 4 bytes, the last is not looked at
  bgra8,      ///< 4 bytes, the last is not looked at
  grey8,      ///< 1 byte
  depth_u16,  ///< 2 bytes in the machine's order, units of 1 / depth_factor metres
  depth_f32,  ///< 4 bytes, metres
};
DKB_SLAM_API const char* name_of(PixelFormat format);
DKB_SLAM_API int bytes_per_pixel(PixelFormat format);

/// Somebody else's pixels. The library reads them during the call that is given the view, never later and never
/// outside of height rows of `stride` bytes.
struct ImageView {
  const void* data = nullptr;              ///< the first byte of the top row
  int width = 0, height = 0;               ///< [px]
  size_t stride = 0;                       ///< [bytes] from a row to the next; 0 = rows are packed
  PixelFormat format = PixelFormat::rgb8;  ///< of every pixel

  bool empty() const { return data == nullptr; }
  size_t row_bytes() const { return static_cast<size_t>(width) * static_cast<size_t>(bytes_per_pixel(format)); }
  const uint8_t* row(int y) const {  ///< the first byte of row y
    return static_cast<const uint8_t*>(data) + static_cast<size_t>(y) * (stride == 0 ? row_bytes() : stride);
  }
};

namespace detail {

// Leaves what is made without a value as it is: an image that is about to be written need not be filled before.
template <class T>
struct NoFill : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = NoFill<U>;
  };
  template <class U>
  void construct(U*) noexcept {
    static_assert(std::is_trivially_copyable_v<U>);
  }
};

}  // namespace detail

/// Owning, densely packed, row-major image. Pixel (x, y): x right, y down, (0, 0) is the centre of the top-left pixel.
template <class T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, T fill = T{})
      : width_(width), height_(height), data_(static_cast<size_t>(width) * static_cast<size_t>(height), fill) {}
  /// Each pixel must be written before it is read.
  static Image unfilled(int width, int height) {
    Image image;
    image.width_ = width, image.height_ = height;
    image.data_.resize(static_cast<size_t>(width) * static_cast<size_t>(height));
    return image;
  }

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
  std::vector<T, detail::NoFill<T>> data_;
};

/// A colour, 8 bits a channel.
struct Rgb {
  uint8_t r = 0, g = 0, b = 0;
  bool operator==(const Rgb&) const = default;
};

using GreyImage = Image<uint8_t>;
using ColourImage = Image<Rgb>;
using DepthImage = Image<float>;  ///< [m] along the optical axis, 0 = no data

/// Axis-aligned rectangle in pixels of the original image: x, y = top-left corner, covering [x, x + w) x [y, y + h).
struct Box {
  float x = 0, y = 0, w = 0, h = 0;

  float area() const { return w * h; }
  bool contains(float px, float py) const { return px >= x && py >= y && px < x + w && py < y + h; }
  bool operator==(const Box&) const = default;
};

/// Where in an image something moves, or may: square cells of `cell` px, 255 = mover. Empty = nothing known to move.
struct MoverMask {
  int cell = 4;          ///< [px] side of a cell
  Image<uint8_t> cells;  ///< cell (x, y) covers the pixels from (cell * x, cell * y)

  bool empty() const { return cells.empty(); }
  /// Whether a pixel of the original image lies in a marked cell.
  bool at(float image_x, float image_y) const {
    // Not by the cell alone: -3 / 4 is 0.
    if (cells.empty() || !(image_x >= 0 && image_y >= 0)) return false;
    const int x = static_cast<int>(image_x) / cell, y = static_cast<int>(image_y) / cell;
    return cells.contains(x, y) && cells(x, y) != 0;
  }
};

}  // namespace dkb
