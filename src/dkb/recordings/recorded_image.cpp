// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_image.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <optional>
#include <vector>

#include "dkb/dataset/image_formats.h"
#include "dkb/image/image.h"
#include "dkb/image/pixel_views.h"
#include "dkb/recordings/bayer.h"
#include "dkb/util/errors.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

struct Encoding {
  const char* name;
  ImageContent content;
  PixelFormat format;  // of bayer_*: grey8
};
constexpr Encoding kEncodings[] = {
    {"rgb8", ImageContent::colour, PixelFormat::rgb8},
    {"bgr8", ImageContent::colour, PixelFormat::bgr8},
    {"rgba8", ImageContent::colour, PixelFormat::rgba8},
    {"bgra8", ImageContent::colour, PixelFormat::bgra8},
    {"mono8", ImageContent::colour, PixelFormat::grey8},
    {"8UC1", ImageContent::colour, PixelFormat::grey8},
    {"8UC3", ImageContent::colour, PixelFormat::bgr8},  // OpenCV's, whose order is blue first
    {"8UC4", ImageContent::colour, PixelFormat::bgra8},
    {"bayer_rggb8", ImageContent::colour, PixelFormat::grey8},
    {"bayer_bggr8", ImageContent::colour, PixelFormat::grey8},
    {"bayer_gbrg8", ImageContent::colour, PixelFormat::grey8},
    {"bayer_grbg8", ImageContent::colour, PixelFormat::grey8},
    {"16UC1", ImageContent::depth, PixelFormat::depth_u16},
    {"mono16", ImageContent::depth, PixelFormat::depth_u16},
    {"32FC1", ImageContent::depth, PixelFormat::depth_f32},
};

const Encoding* encoding_of(const std::string& name) {
  const auto* found = std::find_if(std::begin(kEncodings), std::end(kEncodings),
                                   [&](const Encoding& encoding) { return name == encoding.name; });
  return found == std::end(kEncodings) ? nullptr : found;
}

// Names may hold anything: a message must stay one line.
std::string printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c >= 0x7F; }, '?');
  return text.size() > 60 ? text.substr(0, 60) + "..." : text;
}

void set_size(RecordedImage& image, uint32_t width, uint32_t height) {
  formats::require_side_lengths(width, height, image.name);
  image.width = static_cast<int>(width), image.height = static_cast<int>(height);
}

void open_raw(RecordedImage& image) {
  const Encoding* encoding = encoding_of(image.encoding);
  if (encoding == nullptr) return;
  image.content = encoding->content;
  set_size(image, image.raw.width, image.raw.height);
  const size_t row = static_cast<size_t>(image.width) * static_cast<size_t>(bytes_per_pixel(encoding->format));
  const size_t step = image.raw.step;
  if (step < row) throw InputError(image.name + ": its rows of " + std::to_string(step) + " bytes are too short");
  if (image.raw.data.size() < step * static_cast<size_t>(image.height - 1) + row)
    throw InputError(image.name + ": is truncated");
}

// image_transport writes `ENCODING; jpeg compressed ...`, `ENCODING; compressedDepth [png|rvl]`, or just `jpeg`.
void open_compressed(RecordedImage& image) {
  std::string_view data = image.stored;
  const bool depth_transport = image.encoding.find("compressedDepth") != std::string::npos;
  if (depth_transport) {
    constexpr size_t kHeader = 12;  // a number of the format, and the two of the quantisation
    if (image.encoding.find("rvl") != std::string::npos) return;
    if (data.size() < kHeader) throw InputError(image.name + ": is truncated");
    image.inverse_depth = image.encoding.starts_with("32FC1");
    if (image.inverse_depth)
      for (int i = 0; i < 2; ++i) {
        uint32_t bits = 0;
        for (size_t byte = 0; byte < 4; ++byte)
          bits |= static_cast<uint32_t>(static_cast<uint8_t>(data[4 * static_cast<size_t>(i + 1) + byte]))
                  << (8 * byte);
        image.quantised[i] = std::bit_cast<float>(bits);
      }
    data.remove_prefix(kHeader);
  }
  image.stored = data;
  const ImageHeader header = read_image_header(data, image.name);
  image.width = header.width, image.height = header.height;
  if (why_not_depth(header).empty())
    image.content = ImageContent::depth;
  else if (!depth_transport && why_not_picture(header).empty())
    image.content = ImageContent::colour;
  if (image.inverse_depth && header.kind != ImageKind::png) image.content = ImageContent::unknown;
}

ImageView view_of(const RecordedImage& image) {
  return {image.raw.data.data(), image.width, image.height, image.raw.step, encoding_of(image.encoding)->format};
}

std::string swapped(std::string_view data, size_t size) {
  std::string out(data);
  for (size_t i = 0; i + size <= out.size(); i += size)
    std::reverse(out.begin() + static_cast<std::ptrdiff_t>(i), out.begin() + static_cast<std::ptrdiff_t>(i + size));
  return out;
}

DepthImage raw_depth(const RecordedImage& image, const Camera& range) {
  ImageView view = view_of(image);
  if (image.raw.is_bigendian == (std::endian::native == std::endian::big)) return copy_depth(view, range);
  // Rows may begin at odd bytes: row by row.
  std::string rows;
  for (int y = 0; y < view.height; ++y)
    rows += swapped({reinterpret_cast<const char*>(view.row(y)), view.row_bytes()},
                    static_cast<size_t>(bytes_per_pixel(view.format)));
  view.data = rows.data(), view.stride = 0;
  return copy_depth(view, range);
}

// Inverse depth, as compressedDepth stores floats.
DepthImage dequantised(const RecordedImage& image, const Camera& range) {
  const Image<uint16_t> values =
      formats::decode_png16(image.stored, image.name, read_image_header(image.stored, image.name));
  auto depth = DepthImage::unfilled(values.width(), values.height());
  for (size_t i = 0; i < values.size(); ++i) {
    const uint16_t value = values.data()[i];
    depth.data()[i] = value == 0 ? 0 : image.quantised[0] / (static_cast<float>(value) - image.quantised[1]);
  }
  depth_from_metres(depth.data(), depth.size(), range, depth.data());
  return depth;
}

}  // namespace

RecordedImage read_recorded_image(std::string_view bytes, const std::string& type, MessageEncoding encoding,
                                  const std::string& topic) {
  RecordedImage image;
  image.compressed = type == "sensor_msgs/CompressedImage";
  image.name = topic;
  try {
    if (image.compressed) {
      CompressedImageMessage message = decode_compressed_image(bytes, encoding);
      image.header = std::move(message.header);
      image.encoding = printable(std::move(message.format));
      image.stored = message.data;
    } else {
      image.raw = decode_image(bytes, encoding);
      image.header = image.raw.header;
      image.encoding = printable(image.raw.encoding);
    }
  } catch (const InputError& e) {
    throw InputError(topic + ": a message is broken (" + e.what() + ")");
  }
  image.name += " at " + stamp_text(image.header.stamp_ns);
  image.compressed ? open_compressed(image) : open_raw(image);
  return image;
}

Picture picture_of(const RecordedImage& image) {
  if (image.content != ImageContent::colour)
    throw InputError(image.name + ": is no colour image (" + image.encoding + ")");
  if (image.compressed) return decode_picture(image.stored, image.name);
  Picture picture;
  const ImageView view = view_of(image);
  if (image.encoding.starts_with("bayer_")) {
    if (image.width < 2 || image.height < 2) throw InputError(image.name + ": is too small for a Bayer mosaic");
    picture.colour = demosaiced(view.row(0), view.width, view.height, view.stride, image.encoding.substr(6, 4));
  } else if (view.format == PixelFormat::grey8) {
    picture.grey = copy_grey(view);
    return picture;
  } else {
    picture.colour = copy_colour(view);
  }
  picture.grey = grey_from_colour(picture.colour);
  return picture;
}

DepthImage depth_of(const RecordedImage& image, const Camera& range) {
  if (image.content != ImageContent::depth)
    throw InputError(image.name + ": is no depth image (" + image.encoding + ")");
  Camera millimetres = range;
  millimetres.depth_factor = kMillimetres;
  if (!image.compressed) return raw_depth(image, millimetres);
  if (image.inverse_depth) return dequantised(image, millimetres);
  return decode_depth(image.stored, image.name, millimetres);
}

}  // namespace dkb
