// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/image_codecs.h"

#include <cerrno>
#include <cstring>
#include <fstream>

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
  const std::string type = h.floating ? "-bit float " : "-bit ";
  const std::string colours = h.palette ? "palette " : h.channels >= 3 ? "colour " : h.channels == 1 ? "grey " : "";
  return article + std::to_string(h.bits) + type + colours + kind_name(h.kind);
}

DepthImage metres(Image<float> depth, const Camera& camera) {
  depth_from_metres(depth.data(), depth.size(), camera, depth.data());
  return depth;
}

DepthImage metres(const Image<uint16_t>& units, const Camera& camera) {
  DepthImage depth(units.width(), units.height());
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
  if (h.kind == ImageKind::png && h.bits == 16 && one_channel) return "";
  if (h.floating && h.bits == 32 && one_channel) return "";
  return describe(h);
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

GreyImage read_grey(const std::filesystem::path& path) {
  return read_picture(path).grey;
}

DepthImage decode_depth(std::string_view bytes, const std::string& name, const CameraModel& camera) {
  const ImageHeader header = read_image_header(bytes, name);
  if (const std::string kind = why_not_depth(header); !kind.empty())
    throw InputError(name + ": is " + kind + "; depth must be 16-bit grey PNG, or 32-bit float in TIFF, PFM or NPY");
  switch (header.kind) {
    case ImageKind::png:
      return metres(formats::decode_png16(bytes, name, header), camera);
    case ImageKind::tiff:
      return metres(formats::decode_tiff(bytes, name), camera);
    case ImageKind::pfm:
      return metres(formats::decode_pfm(bytes, name), camera);
    default:
      return metres(formats::decode_npy(bytes, name), camera);
  }
}

DepthImage read_depth(const std::filesystem::path& path, const CameraModel& camera) {
  return decode_depth(read_file(path), path.string(), camera);
}

void write_image_file(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream out(path, std::ios::binary | std::ios::trunc);
  out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) throw OutputError(path.string() + ": cannot be written (" + std::strerror(errno) + ")");
}

}  // namespace dkb
