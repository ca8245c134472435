// SPDX-License-Identifier: Apache-2.0
#include <png.h>

#include <bit>
#include <cstring>
#include <exception>

#include "dkb/dataset/image_formats.h"
#include "dkb/dataset/plain_png.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// libpng reports errors by longjmp. The functions it may jump out of (those that call setjmp, and the callbacks) own
// nothing that needs a destructor; what must be freed belongs to the classes.
struct PngError {
  char text[128] = "";

  static void raise(png_structp png, png_const_charp message) {
    auto* self = static_cast<PngError*>(png_get_error_ptr(png));
    std::strncpy(self->text, message, sizeof self->text - 1);
    png_longjmp(png, 1);
  }
  static void ignore(png_structp, png_const_charp) {}
};

enum class Samples { grey8, rgb8, grey16 };

class PngReader {
 public:
  explicit PngReader(std::string_view bytes) : rest_(bytes) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &error_, PngError::raise, PngError::ignore);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  // False with the reason in error().
  bool read(Samples samples, uint8_t* out, size_t stride, int height) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    read_all(samples, out, stride, height);
    return true;
  }
  const char* error() const { return error_.text; }

 private:
  static void take(png_structp png, png_bytep out, size_t n) {
    auto* self = static_cast<PngReader*>(png_get_io_ptr(png));
    if (n > self->rest_.size()) png_error(png, "the file is truncated");
    std::memcpy(out, self->rest_.data(), n);
    self->rest_.remove_prefix(n);
  }

  void read_all(Samples samples, uint8_t* out, size_t stride, int height) {
    png_set_read_fn(png_, this, take);
    png_set_user_limits(png_, formats::kMaxSide, formats::kMaxSide);
    png_set_chunk_cache_max(png_, 100);
    png_set_chunk_malloc_max(png_, 1 << 23);
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    if (samples == Samples::grey16) {
      if constexpr (std::endian::native == std::endian::little) png_set_swap(png_);
    } else {
      if (png_get_color_type(png_, info_) == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png_);
      if (png_get_bit_depth(png_, info_) < 8) png_set_expand_gray_1_2_4_to_8(png_);
      if (png_get_bit_depth(png_, info_) == 16) png_set_scale_16(png_);
      png_set_strip_alpha(png_);
    }
    const int passes = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    if (png_get_rowbytes(png_, info_) != stride || png_get_image_height(png_, info_) != static_cast<unsigned>(height))
      png_error(png_, "the header contradicts itself");
    for (int pass = 0; pass < passes; ++pass)
      for (int y = 0; y < height; ++y) png_read_row(png_, out + static_cast<size_t>(y) * stride, nullptr);
    png_read_end(png_, nullptr);
  }

  PngError error_;
  std::string_view rest_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

class PngWriter {
 public:
  PngWriter() {
    png_ = png_create_write_struct(PNG_LIBPNG_VER_STRING, &error_, PngError::raise, PngError::ignore);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_write_struct(&png_, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngWriter() { png_destroy_write_struct(&png_, &info_); }
  PngWriter(const PngWriter&) = delete;
  PngWriter& operator=(const PngWriter&) = delete;

  bool write(Samples samples, const uint8_t* in, size_t stride, int width, int height, int compression) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    write_all(samples, in, stride, width, height, compression);
    return true;
  }
  std::string bytes;
  const char* error() const { return error_.text; }

 private:
  static void put(png_structp png, png_bytep data, size_t n) {
    bool done = false;
    try {
      static_cast<PngWriter*>(png_get_io_ptr(png))->bytes.append(reinterpret_cast<const char*>(data), n);
      done = true;
    } catch (const std::exception&) {  // must not pass through C
    }
    if (!done) png_error(png, "out of memory");
  }
  static void flush(png_structp) {}

  void write_all(Samples samples, const uint8_t* in, size_t stride, int width, int height, int compression) {
    png_set_write_fn(png_, this, put, flush);
    png_set_compression_level(png_, compression);
    png_set_IHDR(png_, info_, static_cast<unsigned>(width), static_cast<unsigned>(height),
                 samples == Samples::grey16 ? 16 : 8,
                 samples == Samples::rgb8 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(png_, info_);
    if (samples == Samples::grey16 && std::endian::native == std::endian::little) png_set_swap(png_);
    for (int y = 0; y < height; ++y) png_write_row(png_, in + static_cast<size_t>(y) * stride);
    png_write_end(png_, nullptr);
  }

  PngError error_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
};

template <class Pixel>
std::string encode(Samples samples, const Image<Pixel>& image, int compression) {
  formats::require_side_lengths(image.width(), image.height(), "PNG");
  require_option(compression >= 0 && compression <= 9, "compression", compression, "0 ... 9");
  PngWriter writer;
  if (!writer.write(samples, reinterpret_cast<const uint8_t*>(image.data()),
                    static_cast<size_t>(image.width()) * sizeof(Pixel), image.width(), image.height(), compression))
    throw OutputError(std::string("PNG cannot be encoded (") + writer.error() + ")");
  return std::move(writer.bytes);
}

template <class Pixel>
Image<Pixel> decode(Samples samples, std::string_view bytes, const std::string& name, const ImageHeader& header) {
  auto image = Image<Pixel>::unfilled(header.width, header.height);
  auto* out = reinterpret_cast<uint8_t*>(image.data());
  if (formats::decode_plain_png(bytes, header.width, header.height, sizeof(Pixel), out)) return image;
  PngReader reader(bytes);
  if (!reader.read(samples, out, static_cast<size_t>(header.width) * sizeof(Pixel), header.height))
    throw InputError(name + ": is a broken PNG (" + reader.error() + ")");
  return image;
}

}  // namespace

namespace formats {

ImageHeader png_header(std::string_view bytes, const std::string& name) {
  // Signature (8), length (4), "IHDR" (4), width (4), height (4), depth (1), colour type (1), ...
  if (bytes.size() < 33 || bytes.substr(12, 4) != "IHDR") throw InputError(name + ": is a broken PNG (no header)");
  const auto byte = [&](size_t i) { return static_cast<uint32_t>(static_cast<unsigned char>(bytes[i])); };
  const auto word = [&](size_t i) { return byte(i) << 24 | byte(i + 1) << 16 | byte(i + 2) << 8 | byte(i + 3); };
  require_side_lengths(word(16), word(20), name);
  ImageHeader header;
  header.kind = ImageKind::png;
  header.width = static_cast<int>(word(16)), header.height = static_cast<int>(word(20));
  header.bits = byte(24) == 16 ? 16 : 8;
  switch (byte(25)) {
    case PNG_COLOR_TYPE_GRAY:
      header.channels = 1;
      break;
    case PNG_COLOR_TYPE_GRAY_ALPHA:
      header.channels = 2;
      break;
    case PNG_COLOR_TYPE_RGB:
      header.channels = 3;
      break;
    case PNG_COLOR_TYPE_RGB_ALPHA:
      header.channels = 4;
      break;
    case PNG_COLOR_TYPE_PALETTE:
      header.palette = true;
      break;
    default:
      throw InputError(name + ": is a broken PNG (unknown colour type)");
  }
  return header;
}

void decode_png(std::string_view bytes, const std::string& name, const ImageHeader& header, Picture* picture) {
  if (header.channels >= 3 || header.palette) {
    picture->colour = decode<Rgb>(Samples::rgb8, bytes, name, header);
    picture->grey = grey_from_colour(picture->colour);
  } else {
    picture->grey = decode<uint8_t>(Samples::grey8, bytes, name, header);
  }
}

Image<uint16_t> decode_png16(std::string_view bytes, const std::string& name, const ImageHeader& header) {
  return decode<uint16_t>(Samples::grey16, bytes, name, header);
}

}  // namespace formats

std::string encode_png(const GreyImage& image, int compression) {
  return encode(Samples::grey8, image, compression);
}
std::string encode_png(const ColourImage& image, int compression) {
  return encode(Samples::rgb8, image, compression);
}
std::string encode_png(const Image<uint16_t>& image, int compression) {
  return encode(Samples::grey16, image, compression);
}

}  // namespace dkb
