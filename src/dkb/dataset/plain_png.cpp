// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/plain_png.h"

#if DKB_HAS_DEFLATE
#include <libdeflate.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <string>
#include <type_traits>
#endif

namespace dkb::formats {
#if DKB_HAS_DEFLATE
namespace {

uint32_t big_endian_word(const char* at) {
  uint32_t word = 0;
  for (int i = 0; i < 4; ++i) word = word << 8 | static_cast<unsigned char>(at[i]);
  return word;
}

// Of chunks that say nothing about the pixels.
bool may_be_skipped(std::string_view type, size_t size) {
  constexpr std::string_view kKnown[] = {"gAMA", "cHRM", "sRGB", "sBIT", "bKGD", "pHYs", "tIME", "tEXt"};
  return size <= 1 << 16 && std::find(std::begin(kKnown), std::end(kKnown), type) != std::end(kKnown);
}

// The compressed pixels, when the file is sound and of this kind; else empty.
std::string compressed_pixels(std::string_view bytes, char bits, char colour_type) {
  constexpr size_t kSignature = 8, kAround = 12;  // of a chunk: its size, type and checksum
  std::string pixels;
  bool ended = false, apart = false;
  for (size_t at = kSignature; !ended;) {
    if (bytes.size() < at + kAround) return {};
    const size_t size = big_endian_word(bytes.data() + at);
    if (size > bytes.size() - at - kAround) return {};
    const std::string_view type = bytes.substr(at + 4, 4), data = bytes.substr(at + 8, size);
    if (libdeflate_crc32(0, type.data(), 4 + size) != big_endian_word(data.data() + size)) return {};
    if (at == kSignature) {  // size, then depth, colour type, compression, filters, interlace
      const char wanted[] = {bits, colour_type, 0, 0, 0};
      if (type != "IHDR" || size != 13 || std::memcmp(data.data() + 8, wanted, sizeof wanted) != 0) return {};
    } else if (type == "IDAT") {
      if (apart) return {};
      pixels += data;
    } else if (type == "IEND") {
      ended = true;
    } else if (may_be_skipped(type, size)) {
      apart = !pixels.empty();
    } else {
      return {};
    }
    at += kAround + size;
  }
  return pixels;
}

using Lanes = int16_t __attribute__((vector_size(16)));
using LaneBytes = uint8_t __attribute__((vector_size(8)));

Lanes widened(uint64_t bytes) {
  LaneBytes narrow;
  std::memcpy(&narrow, &bytes, sizeof narrow);
  return __builtin_convertvector(narrow, Lanes);
}

uint64_t narrowed(Lanes lanes) {
  const auto narrow = __builtin_convertvector(lanes, LaneBytes);
  uint64_t bytes = 0;
  std::memcpy(&bytes, &narrow, sizeof bytes);
  return bytes;
}

// |a - b| of lanes that hold no negative numbers.
Lanes distance(Lanes a, Lanes b) {
  return (a > b ? a : b) - (a < b ? a : b);
}

// Lanes of the rows moved to those of the row below, zeros to the first row's.
template <int bpp>
Lanes one_row_down(Lanes v) {
#if defined(__SSE2__)
  return reinterpret_cast<Lanes>(_mm_slli_si128(reinterpret_cast<__m128i>(v), 2 * bpp));
#else
  Lanes down{};
  for (int lane = bpp; lane < 8; ++lane) down[lane] = v[lane - bpp];
  return down;
#endif
}

template <int bpp>
uint64_t load_pixel(const uint8_t* at) {
  // Byte by byte GCC would load each on its own.
  if constexpr (bpp == 3) return load_pixel<2>(at) | static_cast<uint64_t>(at[2]) << 16;
  std::conditional_t<bpp == 2, uint16_t, uint8_t> pixel = 0;
  std::memcpy(&pixel, at, sizeof pixel);
  return pixel;
}

// As many rows as there is room for in 8 lanes, each a pixel behind the one above, so that the pixels on the left,
// above and above left are known for all of them. `first`: the first pixel of the first row, after the byte that names
// its filter. The row before the first one must be there.
template <int bpp>
class RowGroup {
 public:
  static constexpr int kRows = 8 / bpp;

  RowGroup(uint8_t* first, size_t pitch) : first_(first), pitch_(pitch) {
    for (int row = 0; row < kRows; ++row) {
      const uint8_t filter = first[static_cast<ptrdiff_t>(row * pitch) - 1];
      for (int lane = row * bpp; lane < (row + 1) * bpp; ++lane) {
        is_left_[lane] = filter == 1 ? -1 : 0, is_above_[lane] = filter == 2 ? -1 : 0;
        is_mean_[lane] = filter == 3 ? -1 : 0, is_paeth_[lane] = filter == 4 ? -1 : 0;
      }
    }
  }

  // Undoes the filter of pixel x of the first row, x - 1 of the second one, and so on, where these exist.
  template <class Exists>
  void step(int x, const Exists& exists) {
    uint64_t raw = 0;
    for (int row = 0; row < kRows; ++row)
      if (exists(x - row)) raw |= load_pixel<bpp>(at(x - row, row)) << (8 * bpp * row);
    const Lanes above_left = above_;
    above_ = one_row_down<bpp>(left_);
    if (exists(x)) above_ |= widened(load_pixel<bpp>(at(x, 0) - pitch_));
    const Lanes both = left_ + above_;
    const Lanes from_left = distance(above_, above_left), from_above = distance(left_, above_left);
    const Lanes from_both = distance(both, above_left + above_left);
    const Lanes nearest = from_above < from_both ? from_above : from_both;
    const Lanes nearer = from_above <= from_both ? above_ : above_left;
    const Lanes simple = (left_ & is_left_) | (above_ & is_above_) | ((both >> 1) & is_mean_);
    const Lanes expected = ((from_left <= nearest ? left_ : nearer) & is_paeth_) | simple;
    left_ = (widened(raw) + expected) & 255;
    const uint64_t pixels = narrowed(left_);
    for (int row = 0; row < kRows; ++row)
      if (exists(x - row)) {
        const uint64_t pixel = pixels >> (8 * bpp * row);
        std::memcpy(at(x - row, row), &pixel, bpp);
      }
  }

 private:
  uint8_t* at(int x, int row) const { return first_ + row * pitch_ + x * bpp; }

  uint8_t* const first_;
  const size_t pitch_;
  Lanes is_left_{}, is_above_{}, is_mean_{}, is_paeth_{};
  Lanes left_{}, above_{};
};

// Two groups at once, the second one behind the first: the processor works at one while it waits for the other.
template <int bpp>
void unfilter_rows(uint8_t* first, size_t pitch, int width) {
  constexpr int kRows = RowGroup<bpp>::kRows;
  RowGroup<bpp> upper(first, pitch), lower(first + kRows * pitch, pitch);
  const auto step = [&](int x, const auto& exists) {
    upper.step(x, exists);
    lower.step(x - kRows, exists);
  };
  const auto checked = [width](int x) { return x >= 0 && x < width; };
  int x = 0;
  for (; x < 2 * kRows - 1; ++x) step(x, checked);
  for (; x < width; ++x) step(x, [](int) { return true; });
  for (; x < width + 2 * kRows - 1; ++x) step(x, checked);
}

template <int bpp>
bool decode_rows(const std::string& compressed, int width, int height, uint8_t* out) {
  // One row of zeros, rows of a filter's number and pixels, and zeros up to a whole number of groups of rows.
  constexpr int kRows = 2 * RowGroup<bpp>::kRows;
  const size_t pitch = static_cast<size_t>(width) * bpp + 1, rows = static_cast<size_t>(height);
  const size_t below = (kRows - rows % kRows) % kRows;
  const auto buffer = std::make_unique_for_overwrite<uint8_t[]>((1 + rows + below) * pitch);
  uint8_t* const first = buffer.get() + pitch;
  std::memset(buffer.get(), 0, pitch);
  std::memset(first + rows * pitch, 0, below * pitch);
  const std::unique_ptr<libdeflate_decompressor, void (*)(libdeflate_decompressor*)> inflate(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  if (inflate == nullptr || libdeflate_zlib_decompress(inflate.get(), compressed.data(), compressed.size(), first,
                                                       rows * pitch, nullptr) != LIBDEFLATE_SUCCESS)
    return false;
  for (size_t y = 0; y < rows; ++y)
    if (first[y * pitch] > 4) return false;
  for (size_t y = 0; y < rows; y += kRows) unfilter_rows<bpp>(first + y * pitch + 1, pitch, width);
  for (size_t y = 0; y < rows; ++y) {
    const uint8_t* row = first + y * pitch + 1;
    uint8_t* to = out + y * (pitch - 1);
    std::memcpy(to, row, pitch - 1);
    if constexpr (bpp == 2)
      for (size_t i = 0; i + 1 < pitch; i += 2) std::swap(to[i], to[i + 1]);
  }
  return true;
}

}  // namespace

bool decode_plain_png(std::string_view bytes, int width, int height, int bytes_per_pixel, uint8_t* out) {
  if constexpr (std::endian::native != std::endian::little) return false;
  const std::string compressed = compressed_pixels(bytes, bytes_per_pixel == 2 ? 16 : 8, bytes_per_pixel == 3 ? 2 : 0);
  // A stream that names a window of less than the usual size may reach out of it, which libpng calls broken.
  if (compressed.empty() || compressed[0] != 0x78) return false;
  if (bytes_per_pixel == 1) return decode_rows<1>(compressed, width, height, out);
  if (bytes_per_pixel == 2) return decode_rows<2>(compressed, width, height, out);
  return decode_rows<3>(compressed, width, height, out);
}

#else

bool decode_plain_png(std::string_view, int, int, int, uint8_t*) {
  return false;
}

#endif
}  // namespace dkb::formats
