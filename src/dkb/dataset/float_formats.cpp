// SPDX-License-Identifier: Apache-2.0
// Images of 32-bit floats, in NumPy's format also of 16-bit units: TIFF (Revision 6.0, without compression), PFM and
// NumPy's .npy (format 1.0 - 3.0).
#include <bit>
#include <cstring>
#include <map>
#include <vector>

#include "dkb/dataset/image_formats.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"

namespace dkb {
namespace {

[[noreturn]] void broken(const std::string& name, const char* kind, const char* reason) {
  throw InputError(name + ": is a broken " + kind + " (" + reason + ")");
}

float float_from_bits(const char* at, bool big_endian) {
  uint32_t bits = 0;
  for (int i = 0; i < 4; ++i)
    bits |= static_cast<uint32_t>(static_cast<unsigned char>(at[i])) << (big_endian ? 24 - 8 * i : 8 * i);
  return std::bit_cast<float>(bits);
}

void copy_floats(const char* in, bool big_endian, size_t n, float* out) {
  if (big_endian == (std::endian::native == std::endian::big)) {
    std::memcpy(out, in, n * sizeof(float));
  } else {
    for (size_t i = 0; i < n; ++i) out[i] = float_from_bits(in + 4 * i, big_endian);
  }
}

// The first picture of a TIFF file.
class Tiff {
 public:
  Tiff(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {
    if (bytes.size() < 8) broken(name_, "TIFF", "no header");
    big_ = bytes[0] == 'M';
    const size_t directory = number(4, 4);
    const size_t entries = number(directory, 2);
    for (size_t i = 0; i < entries; ++i) {
      const size_t at = directory + 2 + 12 * i;
      fields_[static_cast<int>(number(at, 2))] = {number(at + 2, 2), number(at + 4, 4), at + 8};
    }
    header_.kind = ImageKind::tiff;
    const int64_t width = value(256, 0), height = value(257, 0);
    formats::require_side_lengths(width, height, name);
    header_.width = static_cast<int>(width), header_.height = static_cast<int>(height);
    const int64_t bits = value(258, 1), channels = value(277, 1);
    header_.bits = bits <= 8 ? 8 : static_cast<int>(std::min<int64_t>(bits, 64));
    header_.channels = static_cast<int>(std::min<int64_t>(channels, 1000));
    header_.floating = value(339, 1) == 3;
    header_.palette = value(262, 1) == 3;
  }
  const ImageHeader& header() const { return header_; }

  Image<float> floats() const {
    if (value(259, 1) != 1)
      throw InputError(name_ + ": is a compressed TIFF, which is not supported; store it without compression");
    if (fields_.count(322) != 0 || fields_.count(273) == 0)
      throw InputError(name_ + ": is a TIFF in tiles, which is not supported; store it in strips");
    // Strips may all name one place: memory is set aside for as much as the file holds.
    if (4 * static_cast<size_t>(header_.width) * static_cast<size_t>(header_.height) > bytes_.size())
      broken(name_, "TIFF", "the file is truncated");
    Image<float> image(header_.width, header_.height);
    const std::vector<size_t> offsets = values(273);
    const int64_t rows_per_strip = std::max<int64_t>(1, std::min<int64_t>(value(278, header_.height), header_.height));
    const size_t stride = static_cast<size_t>(header_.width) * sizeof(float);
    int y = 0;
    for (const size_t offset : offsets) {
      const int rows = static_cast<int>(std::min<int64_t>(rows_per_strip, header_.height - y));
      const size_t size = static_cast<size_t>(rows) * stride;
      if (offset > bytes_.size() || size > bytes_.size() - offset) broken(name_, "TIFF", "the file is truncated");
      copy_floats(bytes_.data() + offset, big_, size / sizeof(float), image.row(y));
      y += rows;
      if (y == header_.height) return image;
    }
    broken(name_, "TIFF", "rows are missing");
  }

 private:
  struct Field {
    size_t type, count, at;
  };

  size_t number(size_t at, size_t width) const {
    if (at > bytes_.size() || width > bytes_.size() - at) broken(name_, "TIFF", "the file is truncated");
    size_t result = 0;
    for (size_t i = 0; i < width; ++i)
      result |= static_cast<size_t>(static_cast<unsigned char>(bytes_[at + i])) << (8 * (big_ ? width - 1 - i : i));
    return result;
  }
  // Values of an integer field: in its entry when they fit there, else where the entry points.
  std::vector<size_t> values(int tag) const {
    const Field& field = fields_.at(tag);
    const size_t width = field.type == 3 ? 2 : 4;
    if (field.type != 3 && field.type != 4) broken(name_, "TIFF", "a field has an unknown type");
    if (field.count == 0 || field.count > bytes_.size()) broken(name_, "TIFF", "a field has a wrong length");
    const size_t at = field.count * width <= 4 ? field.at : number(field.at, 4);
    std::vector<size_t> result;
    for (size_t i = 0; i < field.count; ++i) result.push_back(number(at + i * width, width));
    return result;
  }
  int64_t value(int tag, int64_t otherwise) const {
    return fields_.count(tag) == 0 ? otherwise : static_cast<int64_t>(values(tag).front());
  }

  std::string_view bytes_;
  const std::string& name_;
  bool big_ = false;
  std::map<int, Field> fields_;
  ImageHeader header_;
};

// PFM: "Pf" (one channel) or "PF", width, height, scale (negative: little endian), one white space, rows from the
// bottom up.
struct Pfm {
  ImageHeader header;
  bool big_endian = false;
  size_t data = 0;  // where the samples begin
};

Pfm parse_pfm(std::string_view bytes, const std::string& name) {
  Pfm pfm;
  pfm.header.kind = ImageKind::pfm;
  pfm.header.channels = bytes.substr(0, 2) == "PF" ? 3 : 1;
  pfm.header.bits = 32;
  pfm.header.floating = true;
  size_t at = 2;
  const auto word = [&] {
    constexpr std::string_view kSpace = " \t\r\n";
    const size_t first = bytes.find_first_not_of(kSpace, at);
    const size_t end = first == std::string_view::npos ? first : bytes.find_first_of(kSpace, first);
    if (end == std::string_view::npos || end - first > 32) broken(name, "PFM", "no header");
    at = end;
    return bytes.substr(first, end - first);
  };
  int64_t width = 0, height = 0;
  double scale = 0;
  if (!parse_number(word(), &width) || !parse_number(word(), &height) || !parse_number(word(), &scale) || !(scale != 0))
    broken(name, "PFM", "the header is not `Pf width height scale`");
  formats::require_side_lengths(width, height, name);
  pfm.header.width = static_cast<int>(width), pfm.header.height = static_cast<int>(height);
  pfm.big_endian = scale > 0;
  pfm.data = at + 1;
  return pfm;
}

// .npy: magic, version, length of the header, the header as a Python dict, samples.
struct Npy {
  ImageHeader header;
  bool big_endian = false;
  size_t data = 0;
};

Npy parse_npy(std::string_view bytes, const std::string& name) {
  if (bytes.size() < 12) broken(name, "NPY", "no header");
  const auto byte = [&](size_t i) { return static_cast<size_t>(static_cast<unsigned char>(bytes[i])); };
  const bool short_length = byte(6) == 1;
  const size_t length = byte(8) | byte(9) << 8 | (short_length ? 0 : byte(10) << 16 | byte(11) << 24);
  const size_t begin = short_length ? 10 : 12;
  if (length > bytes.size() - begin) broken(name, "NPY", "the file is truncated");
  const std::string_view dict = bytes.substr(begin, length);
  const auto value_of = [&](std::string_view key) {
    const size_t found = dict.find(key);
    if (found == std::string_view::npos) broken(name, "NPY", "the header lacks a key");
    std::string_view rest = dict.substr(found + key.size());
    rest.remove_prefix(std::min(rest.find_first_not_of(" :"), rest.size()));
    return rest;
  };
  Npy npy;
  npy.data = begin + length;
  npy.header.kind = ImageKind::npy;
  const std::string_view type = value_of("'descr'").substr(0, 5);
  npy.big_endian = type.substr(0, 2) == "'>";
  npy.header.floating = type.size() == 5 && type[2] == 'f';
  npy.header.with_sign = type.size() == 5 && type[2] != 'f' && type[2] != 'u';
  npy.header.bits = type.size() == 5 && type[3] >= '1' && type[3] <= '8' ? 8 * (type[3] - '0') : 8;
  if (value_of("'fortran_order'").substr(0, 5) != "False")
    throw InputError(name + ": is an NPY file in Fortran order, which is not supported; store it in C order");

  std::string_view shape = value_of("'shape'");
  const size_t close = shape.find(')');
  if (shape.empty() || shape[0] != '(' || close == std::string_view::npos)
    broken(name, "NPY", "the shape is not a tuple");
  shape = shape.substr(1, close - 1);
  std::vector<int64_t> sides;
  while (!shape.empty() && sides.size() < 4) {
    const size_t comma = std::min(shape.find(','), shape.size());
    std::string_view side = shape.substr(0, comma);
    shape.remove_prefix(std::min(comma + 1, shape.size()));
    while (!side.empty() && side.front() == ' ') side.remove_prefix(1);
    if (side.empty()) continue;
    int64_t n = 0;
    if (!parse_number(side, &n)) broken(name, "NPY", "the shape is not of numbers");
    sides.push_back(n);
  }
  if (sides.size() != 2 && sides.size() != 3) broken(name, "NPY", "the shape is not (height, width)");
  formats::require_side_lengths(sides[1], sides[0], name);
  npy.header.width = static_cast<int>(sides[1]), npy.header.height = static_cast<int>(sides[0]);
  if (sides.size() == 3)
    npy.header.channels = static_cast<int>(std::min<int64_t>(std::max<int64_t>(sides[2], 0), 1000));
  return npy;
}

// Samples of an image stored whole from `data` on.
std::string_view samples(std::string_view bytes, size_t data, const ImageHeader& header, const std::string& name,
                         const char* kind) {
  const size_t size =
      static_cast<size_t>(header.width) * static_cast<size_t>(header.height) * static_cast<size_t>(header.bits / 8);
  if (data > bytes.size() || size > bytes.size() - data) broken(name, kind, "the file is truncated");
  return bytes.substr(data, size);
}

std::string little_endian_bytes(const Image<float>& image, int y) {
  std::string out;
  for (int x = 0; x < image.width(); ++x) {
    const auto bits = std::bit_cast<uint32_t>(image(x, y));
    for (int i = 0; i < 4; ++i) out += static_cast<char>(bits >> (8 * i) & 0xFF);
  }
  return out;
}

}  // namespace

namespace formats {

ImageHeader tiff_header(std::string_view bytes, const std::string& name) {
  return Tiff(bytes, name).header();
}
Image<float> decode_tiff(std::string_view bytes, const std::string& name) {
  return Tiff(bytes, name).floats();
}

ImageHeader pfm_header(std::string_view bytes, const std::string& name) {
  return parse_pfm(bytes, name).header;
}

Image<float> decode_pfm(std::string_view bytes, const std::string& name) {
  const Pfm pfm = parse_pfm(bytes, name);
  const std::string_view data = samples(bytes, pfm.data, pfm.header, name, "PFM");
  Image<float> image(pfm.header.width, pfm.header.height);
  const size_t width = static_cast<size_t>(image.width());
  for (int y = 0; y < image.height(); ++y)
    copy_floats(data.data() + 4 * width * static_cast<size_t>(image.height() - 1 - y), pfm.big_endian, width,
                image.row(y));
  return image;
}

ImageHeader npy_header(std::string_view bytes, const std::string& name) {
  return parse_npy(bytes, name).header;
}

Image<float> decode_npy(std::string_view bytes, const std::string& name) {
  const Npy npy = parse_npy(bytes, name);
  const std::string_view data = samples(bytes, npy.data, npy.header, name, "NPY");
  Image<float> image(npy.header.width, npy.header.height);
  copy_floats(data.data(), npy.big_endian, image.size(), image.data());
  return image;
}

Image<uint16_t> decode_npy16(std::string_view bytes, const std::string& name) {
  const Npy npy = parse_npy(bytes, name);
  const std::string_view data = samples(bytes, npy.data, npy.header, name, "NPY");
  Image<uint16_t> image(npy.header.width, npy.header.height);
  for (size_t i = 0; i < image.size(); ++i) {
    const auto byte = [&](size_t k) { return static_cast<unsigned>(static_cast<unsigned char>(data[2 * i + k])); };
    image.data()[i] = static_cast<uint16_t>(npy.big_endian ? byte(0) << 8 | byte(1) : byte(1) << 8 | byte(0));
  }
  return image;
}

}  // namespace formats

std::string encode_tiff(const Image<float>& image) {
  formats::require_side_lengths(image.width(), image.height(), "TIFF");
  const auto width = static_cast<uint32_t>(image.width()), height = static_cast<uint32_t>(image.height());
  std::string out("II*\0", 4);
  const auto put = [&out](uint32_t value, int n) {
    for (int i = 0; i < n; ++i) out += static_cast<char>(value >> (8 * i) & 0xFF);
  };
  put(8 + 4 * width * height, 4);  // the directory follows the samples
  for (int y = 0; y < image.height(); ++y) out += little_endian_bytes(image, y);
  const std::pair<uint32_t, uint32_t> fields[] = {{256, width}, {257, height}, {258, 32},
                                                  {259, 1},     {262, 1},      {273, 8},
                                                  {277, 1},     {278, height}, {279, 4 * width * height},
                                                  {339, 3}};
  put(static_cast<uint32_t>(std::size(fields)), 2);
  for (const auto& [tag, value] : fields) put(tag, 2), put(4, 2), put(1, 4), put(value, 4);
  put(0, 4);
  return out;
}

}  // namespace dkb
