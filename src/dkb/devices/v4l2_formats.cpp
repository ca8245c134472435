// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/v4l2_formats.h"

#include <linux/videodev2.h>

#include <algorithm>
#include <cstring>
#include <iterator>

#include "dkb/dataset/image_codecs.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

struct Format {
  V4l2Pixels pixels;
  uint32_t fourcc;
  size_t bytes;  // a pixel; 0 = compressed
  PixelFormat format;
};

constexpr Format kFormats[] = {
    {V4l2Pixels::rgb24, V4L2_PIX_FMT_RGB24, 3, PixelFormat::rgb8},
    {V4l2Pixels::bgr24, V4L2_PIX_FMT_BGR24, 3, PixelFormat::bgr8},
    {V4l2Pixels::grey, V4L2_PIX_FMT_GREY, 1, PixelFormat::grey8},
    {V4l2Pixels::yuyv, V4L2_PIX_FMT_YUYV, 2, PixelFormat::rgb8},
    {V4l2Pixels::mjpeg, V4L2_PIX_FMT_MJPEG, 0, PixelFormat::rgb8},
    {V4l2Pixels::z16, V4L2_PIX_FMT_Z16, 2, PixelFormat::depth_u16},
};

const Format& format_of(V4l2Pixels pixels) {
  return *std::find_if(std::begin(kFormats), std::end(kFormats), [&](const Format& f) { return f.pixels == pixels; });
}

uint8_t clamped(int value) {  // of 8 fractional bits
  return static_cast<uint8_t>(std::clamp((value + 128) >> 8, 0, 255));
}

// Two pixels of four bytes: Y0 U Y1 V.
void rgb_from_yuyv(const uint8_t* in, int width, uint8_t* out) {
  for (int x = 0; x < width; ++x, out += 3) {
    const uint8_t* pair = in + 4 * (x / 2);
    const int y = 298 * (pair[2 * (x % 2)] - 16), u = pair[1] - 128, v = pair[3] - 128;
    out[0] = clamped(y + 409 * v);
    out[1] = clamped(y - 100 * u - 208 * v);
    out[2] = clamped(y + 516 * u);
  }
}

ImageView from_jpeg(const uint8_t* data, size_t size, int width, int height, std::vector<uint8_t>* scratch,
                    const std::string& name) {
  const Picture picture = decode_picture({reinterpret_cast<const char*>(data), size}, name);
  if (picture.grey.width() != width || picture.grey.height() != height)
    throw InputError(name + ": a JPEG of " + std::to_string(picture.grey.width()) + "x" +
                     std::to_string(picture.grey.height()) + " px came instead of one of " + std::to_string(width) +
                     "x" + std::to_string(height));
  const auto keep = [&](const auto& image, PixelFormat format) -> ImageView {
    const auto* bytes = reinterpret_cast<const uint8_t*>(image.data());
    scratch->assign(bytes, bytes + image.size() * sizeof *image.data());
    return {scratch->data(), width, height, 0, format};
  };
  return picture.colour.empty() ? keep(picture.grey, PixelFormat::grey8) : keep(picture.colour, PixelFormat::rgb8);
}

}  // namespace

bool v4l2_pixels_of(uint32_t fourcc, V4l2Pixels* pixels) {
  for (const Format& format : kFormats)
    if (format.fourcc == fourcc) {
      *pixels = format.pixels;
      return true;
    }
  return false;
}

uint32_t fourcc_of(V4l2Pixels pixels) {
  return format_of(pixels).fourcc;
}

ImageView v4l2_image(V4l2Pixels pixels, const uint8_t* data, size_t size, int width, int height, size_t stride,
                     std::vector<uint8_t>* scratch, const std::string& name) {
  if (pixels == V4l2Pixels::mjpeg) return from_jpeg(data, size, width, height, scratch, name);
  const Format& format = format_of(pixels);
  const auto w = static_cast<size_t>(width), h = static_cast<size_t>(height);
  // Of YUYV the last pixel of an odd row has its colour in a whole group.
  const size_t row = pixels == V4l2Pixels::yuyv ? (w + 1) / 2 * 4 : w * format.bytes;
  if (stride == 0) stride = row;
  if (width < 1 || height < 1 || stride < row || size < (h - 1) * stride + row)
    throw InputError(name + ": an image of " + std::to_string(size) + " bytes is too short for " +
                     std::to_string(width) + "x" + std::to_string(height) + " px");
  if (pixels != V4l2Pixels::yuyv) return {data, width, height, stride, format.format};
  scratch->resize(w * h * 3);
  for (size_t y = 0; y < h; ++y) rgb_from_yuyv(data + y * stride, width, scratch->data() + y * w * 3);
  return {scratch->data(), width, height, 0, format.format};
}

}  // namespace dkb
