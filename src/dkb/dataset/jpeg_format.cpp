// SPDX-License-Identifier: Apache-2.0
#include <cstddef>
#include <cstdio>
// libjpeg's header needs <cstdio> before it.
#include <jerror.h>
#include <jpeglib.h>

#include <csetjmp>
#include <cstdlib>
#include <cstring>

#include "dkb/dataset/image_formats.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr int kMaxScans = 200;  // a progressive file of more is made to waste time

// libjpeg reports errors by a callback that must not return: it jumps back into the member function that called
// libjpeg. Those functions own nothing that needs a destructor.
struct JpegError {
  jpeg_error_mgr manager;  // first, because libjpeg hands back a pointer to it
  std::jmp_buf back;
  char text[JMSG_LENGTH_MAX];

  static JpegError* of(j_common_ptr jpeg) { return reinterpret_cast<JpegError*>(jpeg->err); }
  [[noreturn]] static void raise(j_common_ptr jpeg) {
    jpeg->err->format_message(jpeg, of(jpeg)->text);
    std::longjmp(of(jpeg)->back, 1);
  }
  // libjpeg fills in grey and goes on when data are missing or wrong, and calls it a warning. Only what leaves every
  // pixel right is let pass.
  static void on_message(j_common_ptr jpeg, int level) {
    const int code = jpeg->err->msg_code;
    const bool harmless = code == JWRN_ADOBE_XFORM || code == JWRN_EXTRANEOUS_DATA || code == JWRN_TOO_MUCH_DATA;
    if (level < 0 && !harmless) raise(jpeg);
  }
  void attach() {
    text[0] = '\0';
    jpeg_std_error(&manager);
    manager.error_exit = raise;
    manager.emit_message = on_message;
  }
};

class JpegReader {
 public:
  explicit JpegReader(std::string_view bytes) : bytes_(bytes) {
    std::memset(&jpeg_, 0, sizeof jpeg_);
    error_.attach();
    jpeg_.err = &error_.manager;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  // Both: false with the reason in error().
  bool read_header() {
    if (setjmp(error_.back) != 0) return false;
    jpeg_create_decompress(&jpeg_);
    jpeg_mem_src(&jpeg_, reinterpret_cast<const unsigned char*>(bytes_.data()),
                 static_cast<unsigned long>(bytes_.size()));
    jpeg_read_header(&jpeg_, TRUE);
    return true;
  }
  bool read_pixels(uint8_t* out, size_t stride) {
    if (setjmp(error_.back) != 0) return false;
    read_all(out, stride);
    return true;
  }
  int64_t width() const { return jpeg_.image_width; }
  int64_t height() const { return jpeg_.image_height; }
  bool grey() const { return jpeg_.num_components == 1; }
  int components() const { return jpeg_.num_components; }
  const char* error() const { return error_.text; }

 private:
  static void count_scans(j_common_ptr jpeg) {
    if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number > kMaxScans) {
      jpeg->err->msg_code = JERR_BAD_PROGRESSION;
      JpegError::raise(jpeg);
    }
  }
  void read_all(uint8_t* out, size_t stride) {
    jpeg_.out_color_space = grey() ? JCS_GRAYSCALE : JCS_RGB;
    progress_ = {};
    progress_.progress_monitor = count_scans;
    jpeg_.progress = &progress_;
    jpeg_start_decompress(&jpeg_);
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = out + static_cast<size_t>(jpeg_.output_scanline) * stride;
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
  }

  std::string_view bytes_;
  JpegError error_;
  jpeg_progress_mgr progress_{};
  jpeg_decompress_struct jpeg_;
};

class JpegWriter {
 public:
  JpegWriter() {
    std::memset(&jpeg_, 0, sizeof jpeg_);
    error_.attach();
    jpeg_.err = &error_.manager;
  }
  ~JpegWriter() {
    jpeg_destroy_compress(&jpeg_);
    std::free(buffer_);  // libjpeg allocates it with malloc
  }
  JpegWriter(const JpegWriter&) = delete;
  JpegWriter& operator=(const JpegWriter&) = delete;

  bool write(const uint8_t* in, int width, int height, int channels, int quality) {
    if (setjmp(error_.back) != 0) return false;
    write_all(in, width, height, channels, quality);
    return true;
  }
  std::string bytes() const { return {reinterpret_cast<const char*>(buffer_), size_}; }
  const char* error() const { return error_.text; }

 private:
  void write_all(const uint8_t* in, int width, int height, int channels, int quality) {
    jpeg_create_compress(&jpeg_);
    jpeg_mem_dest(&jpeg_, &buffer_, &size_);
    jpeg_.image_width = static_cast<JDIMENSION>(width), jpeg_.image_height = static_cast<JDIMENSION>(height);
    jpeg_.input_components = channels;
    jpeg_.in_color_space = channels == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&jpeg_);
    jpeg_set_quality(&jpeg_, quality, TRUE);
    if (quality >= 90) jpeg_.comp_info[0].h_samp_factor = jpeg_.comp_info[0].v_samp_factor = 1;
    jpeg_start_compress(&jpeg_, TRUE);
    const size_t stride = static_cast<size_t>(width) * static_cast<size_t>(channels);
    while (jpeg_.next_scanline < jpeg_.image_height) {
      JSAMPROW row =
          const_cast<uint8_t*>(in) + static_cast<size_t>(jpeg_.next_scanline) * stride;  // libjpeg only reads
      jpeg_write_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_compress(&jpeg_);
  }

  JpegError error_;
  jpeg_compress_struct jpeg_;
  unsigned char* buffer_ = nullptr;
  unsigned long size_ = 0;
};

[[noreturn]] void fail(const std::string& name, const JpegReader& reader) {
  throw InputError(name + ": is a broken JPEG (" + reader.error() + ")");
}

template <class Pixel>
std::string encode(const Image<Pixel>& image, int quality) {
  formats::require_side_lengths(image.width(), image.height(), "JPEG");
  require_option(quality >= 1 && quality <= 100, "quality", quality, "1 ... 100");
  JpegWriter writer;
  if (!writer.write(reinterpret_cast<const uint8_t*>(image.data()), image.width(), image.height(),
                    static_cast<int>(sizeof(Pixel)), quality))
    throw OutputError(std::string("JPEG cannot be encoded (") + writer.error() + ")");
  return writer.bytes();
}

}  // namespace

namespace formats {

ImageHeader jpeg_header(std::string_view bytes, const std::string& name) {
  JpegReader reader(bytes);
  if (!reader.read_header()) fail(name, reader);
  require_side_lengths(reader.width(), reader.height(), name);
  ImageHeader header;
  header.kind = ImageKind::jpeg;
  header.width = static_cast<int>(reader.width()), header.height = static_cast<int>(reader.height());
  header.channels = reader.components();
  return header;
}

void decode_jpeg(std::string_view bytes, const std::string& name, Picture* picture) {
  JpegReader reader(bytes);
  if (!reader.read_header()) fail(name, reader);
  require_side_lengths(reader.width(), reader.height(), name);
  const int width = static_cast<int>(reader.width()), height = static_cast<int>(reader.height());
  if (reader.grey()) {
    picture->grey = GreyImage::unfilled(width, height);
    if (!reader.read_pixels(picture->grey.data(), static_cast<size_t>(width))) fail(name, reader);
  } else {
    picture->colour = ColourImage::unfilled(width, height);
    if (!reader.read_pixels(reinterpret_cast<uint8_t*>(picture->colour.data()), 3 * static_cast<size_t>(width)))
      fail(name, reader);
    picture->grey = grey_from_colour(picture->colour);
  }
}

}  // namespace formats

std::string encode_jpeg(const ColourImage& image, int quality) {
  return encode(image, quality);
}
std::string encode_jpeg(const GreyImage& image, int quality) {
  return encode(image, quality);
}

}  // namespace dkb
