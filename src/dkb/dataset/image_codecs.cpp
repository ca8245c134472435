// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/image_codecs.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "dkb/dataset/image_formats.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb {

namespace formats {

void require_side_lengths(int64_t width, int64_t height, const std::string& name) {
  if (width < 1 || height < 1 || width > kMaxSide || height > kMaxSide)
    throw InputError(name + ": an image of " + std::to_string(width) + "x" + std::to_string(height) +
                     " px; sides must be 1 ... " + std::to_string(kMaxSide));
}

}  // namespace formats

namespace {

std::string kind_name(ImageKind kind) {
  switch (kind) {
    case ImageKind::png:
      return "PNG";
    case ImageKind::jpeg:
      return "JPEG";
    case ImageKind::tiff:
      return "TIFF";
    case ImageKind::pfm:
      return "PFM";
    case ImageKind::npy:
      return "NPY";
  }
  return "image";
}

// What a header describes, for messages: "an 8-bit grey PNG".
std::string describe(const ImageHeader& h) {
  const std::string article = h.bits == 8 ? "an " : "a ";
  const std::string type = h.floating ? "-bit float " : h.with_sign ? "-bit signed " : "-bit ";
  const std::string colours = h.palette ? "palette " : h.channels >= 3 ? "colour " : h.channels == 1 ? "grey " : "";
  return article + std::to_string(h.bits) + type + colours + kind_name(h.kind);
}

DepthImage metres(Image<float> depth, const Camera& camera) {
  depth_from_metres(depth.data(), depth.size(), camera, depth.data());
  return depth;
}

DepthImage metres(const Image<uint16_t>& units, const Camera& camera) {
  auto depth = DepthImage::unfilled(units.width(), units.height());
  depth_from_units(units.data(), units.size(), camera, depth.data());
  return depth;
}

}  // namespace

namespace {

ImageHeader header_by_kind(std::string_view bytes, const std::string& name) {
  const auto begins = [&](std::string_view magic) { return bytes.substr(0, magic.size()) == magic; };
  if (bytes.empty()) throw InputError(name + ": is empty");
  if (begins("\x89PNG\r\n\x1A\n")) return formats::png_header(bytes, name);
  if (begins("\xFF\xD8\xFF")) return formats::jpeg_header(bytes, name);
  if (begins(std::string_view("II*\0", 4)) || begins(std::string_view("MM\0*", 4)))
    return formats::tiff_header(bytes, name);
  if (begins("Pf") || begins("PF")) return formats::pfm_header(bytes, name);
  if (begins("\x93NUMPY")) return formats::npy_header(bytes, name);
  throw InputError(name + ": is not an image of a known kind (PNG, JPEG; depth also TIFF, PFM, NPY)");
}

}  // namespace

ImageHeader read_image_header(std::string_view bytes, const std::string& name) {
  const ImageHeader header = header_by_kind(bytes, name);
  // No format packs more than 8 pixels a byte, nor deflate more than 1032 to 1: what claims to be larger lacks its
  // pixels, and needs no memory set aside for them.
  constexpr double kMaxPixelsPerByte = 8.0 * 1032.0;
  if (static_cast<double>(header.width) * header.height > kMaxPixelsPerByte * static_cast<double>(bytes.size()))
    throw InputError(name + ": is truncated");
  return header;
}

std::string why_not_picture(const ImageHeader& h) {
  return h.kind == ImageKind::png || h.kind == ImageKind::jpeg ? "" : describe(h);
}

std::string why_not_depth(const ImageHeader& h) {
  const bool one_channel = h.channels == 1 && !h.palette;
  const bool units = h.kind == ImageKind::png || (h.kind == ImageKind::npy && !h.floating && !h.with_sign);
  if (units && h.bits == 16 && one_channel) return "";
  if (h.floating && h.bits == 32 && one_channel) return "";
  return describe(h);
}

std::string depth_remedy(const ImageHeader& h) {
  return std::string("; depth must be 16-bit grey PNG, 32-bit float in TIFF or PFM, or uint16 or float32 in NPY") +
         (h.kind == ImageKind::npy ? ": store depth.astype(np.float32) in metres" : "");
}

Picture decode_picture(std::string_view bytes, const std::string& name) {
  const ImageHeader header = read_image_header(bytes, name);
  if (const std::string kind = why_not_picture(header); !kind.empty())
    throw InputError(name + ": is " + kind + "; a picture must be PNG or JPEG");
  Picture picture;
  if (header.kind == ImageKind::png) formats::decode_png(bytes, name, header, &picture);
  if (header.kind == ImageKind::jpeg) formats::decode_jpeg(bytes, name, &picture);
  return picture;
}

Picture read_picture(const std::filesystem::path& path) {
  return decode_picture(read_file(path), path.string());
}

namespace {

// What a pixel of the smaller image covers along one side of the larger one: the first pixel, and the share of each.
struct Span {
  int first = 0;
  std::vector<float> shares;  // their sum is 1
};

std::vector<Span> spans_of(int size, int new_size) {
  std::vector<Span> spans(static_cast<size_t>(new_size));
  const double step = static_cast<double>(size) / new_size;
  for (int i = 0; i < new_size; ++i) {
    const double begin = i * step, end = std::min<double>(size, (i + 1) * step);
    Span& span = spans[static_cast<size_t>(i)];
    span.first = static_cast<int>(begin);
    for (int k = span.first; k < end; ++k)
      span.shares.push_back(static_cast<float>((std::min(end, k + 1.0) - std::max<double>(begin, k)) / step));
  }
  return spans;
}

template <class Pixel>
Image<Pixel> area_means(const Image<Pixel>& in, int width, int height) {
  constexpr size_t channels = sizeof(Pixel);
  const std::vector<Span> columns = spans_of(in.width(), width), rows = spans_of(in.height(), height);
  Image<Pixel> out(width, height);
  std::vector<float> sums(static_cast<size_t>(in.width()) * channels);  // of the rows that an output row covers
  for (int y = 0; y < height; ++y) {
    const Span& row = rows[static_cast<size_t>(y)];
    std::fill(sums.begin(), sums.end(), 0.0F);
    for (size_t k = 0; k < row.shares.size(); ++k) {
      const auto* bytes = reinterpret_cast<const uint8_t*>(in.row(row.first + static_cast<int>(k)));
      for (size_t i = 0; i < sums.size(); ++i) sums[i] += row.shares[k] * static_cast<float>(bytes[i]);
    }
    auto* to = reinterpret_cast<uint8_t*>(out.row(y));
    for (const Span& column : columns)
      for (size_t c = 0; c < channels; ++c) {
        float mean = 0;
        for (size_t k = 0; k < column.shares.size(); ++k)
          mean += column.shares[k] * sums[(static_cast<size_t>(column.first) + k) * channels + c];
        *to++ = static_cast<uint8_t>(std::min(255.0F, mean + 0.5F));
      }
  }
  return out;
}

}  // namespace

Picture resampled(const Picture& picture, int width, int height) {
  if (picture.grey.width() == width && picture.grey.height() == height) return picture;
  Picture result;
  if (picture.colour.empty()) {
    result.grey = area_means(picture.grey, width, height);
  } else {
    result.colour = area_means(picture.colour, width, height);
    result.grey = grey_from_colour(result.colour);
  }
  return result;
}

GreyImage read_mask(const std::filesystem::path& path) {
  const std::string bytes = read_file(path), name = path.string();
  const ImageHeader header = read_image_header(bytes, name);
  GreyImage mask(header.width, header.height);
  const auto mark = [&](const auto& samples) {
    for (size_t i = 0; i < mask.size(); ++i) mask.data()[i] = samples.data()[i] > 0 ? 255 : 0;
  };
  if (header.kind == ImageKind::png && header.bits == 16 && header.channels == 1)
    mark(formats::decode_png16(bytes, name, header));
  else
    mark(decode_picture(bytes, name).grey);
  return mask;
}

DepthImage decode_depth(std::string_view bytes, const std::string& name, const CameraModel& camera) {
  const ImageHeader header = read_image_header(bytes, name);
  if (const std::string kind = why_not_depth(header); !kind.empty())
    throw InputError(name + ": is " + kind + depth_remedy(header));
  switch (header.kind) {
    case ImageKind::png:
      return metres(formats::decode_png16(bytes, name, header), camera);
    case ImageKind::tiff:
      return metres(formats::decode_tiff(bytes, name), camera);
    case ImageKind::pfm:
      return metres(formats::decode_pfm(bytes, name), camera);
    default:
      return header.floating ? metres(formats::decode_npy(bytes, name), camera)
                             : metres(formats::decode_npy16(bytes, name), camera);
  }
}

DepthImage read_depth(const std::filesystem::path& path, const CameraModel& camera) {
  return decode_depth(read_file(path), path.string(), camera);
}

void write_image_file(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) fail_to_write(path, "write", errno);
}

}  // namespace dkb
