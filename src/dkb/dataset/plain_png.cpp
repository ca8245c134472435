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
        by_left_[lane] = filter == 1 || filter == 4 ? -1 : 0, by_above_[lane] = filter == 2 || filter == 4 ? -1 : 0;
        by_mean_[lane] = filter == 3 ? -1 : 0, by_all_[lane] = filter == 4 ? -1 : 0;
      }
    }
  }

  // Undoes the filter of pixel x of the first row, x - 1 of the second one, and so on, where these exist.
  template <class Exists>
  void step(int x, const Exists& exists) {
    uint64_t raw = 0;
    for (int row = 0; row < kRows; ++row)
      if (exists(x - row)) raw |= load_pixel<bpp>(at(x - row, row)) << (8 * bpp * row);
    Lanes above = one_row_down<bpp>(left_);
    if (exists(x)) above |= widened(load_pixel<bpp>(at(x, 0) - pitch_));
    const uint64_t pixels = narrowed(unfiltered(widened(raw), above));
    for (int row = 0; row < kRows; ++row)
      if (exists(x - row)) {
        const uint64_t pixel = pixels >> (8 * bpp * row);
        std::memcpy(at(x - row, row), &pixel, bpp);
      }
  }

#if defined(__SSE2__)
  // The same of eight pixels in a row, all of which exist. Of two bytes: the rows are turned into columns and back.
  void take_eight(int x) {
    static_assert(bpp == 2);
    for (int row = 0; row < 4; ++row) tile_[row] = load(at(x - row, row));
    const __m128i upper[] = {_mm_unpacklo_epi16(tile_[0], tile_[1]), _mm_unpackhi_epi16(tile_[0], tile_[1])};
    const __m128i lower[] = {_mm_unpacklo_epi16(tile_[2], tile_[3]), _mm_unpackhi_epi16(tile_[2], tile_[3])};
    for (int half = 0; half < 2; ++half) {
      tile_[2 * half] = _mm_unpacklo_epi32(upper[half], lower[half]);
      tile_[2 * half + 1] = _mm_unpackhi_epi32(upper[half], lower[half]);
    }
    const __m128i above = load(at(x, 0) - pitch_), none = _mm_setzero_si128();
    above_[0] = _mm_unpacklo_epi8(above, none), above_[1] = _mm_unpackhi_epi8(above, none);
  }
  // Two pixels of each row.
  template <int pair>
  void step_twice() {
    const __m128i none = _mm_setzero_si128();
    const __m128i even = step_in_tile(_mm_unpacklo_epi8(tile_[pair], none), 2 * pair);
    tile_[pair] = _mm_packus_epi16(even, step_in_tile(_mm_unpackhi_epi8(tile_[pair], none), 2 * pair + 1));
  }
  void give_eight(int x) {
    __m128i halves[4];
    for (int half = 0; half < 2; ++half) {
      const __m128i even = _mm_unpacklo_epi16(tile_[2 * half], tile_[2 * half + 1]);
      const __m128i odd = _mm_unpackhi_epi16(tile_[2 * half], tile_[2 * half + 1]);
      halves[half] = _mm_unpacklo_epi16(even, odd), halves[2 + half] = _mm_unpackhi_epi16(even, odd);
    }
    for (int pair = 0; pair < 2; ++pair) {
      store(at(x - 2 * pair, 2 * pair), _mm_unpacklo_epi64(halves[2 * pair], halves[2 * pair + 1]));
      store(at(x - 2 * pair - 1, 2 * pair + 1), _mm_unpackhi_epi64(halves[2 * pair], halves[2 * pair + 1]));
    }
  }
#endif

 private:
  uint8_t* at(int x, int row) const {
    return first_ + row * pitch_ + x * bpp;
  }
#if defined(__SSE2__)
  __m128i step_in_tile(__m128i raw, int x) {
    const __m128i above = above_[x / 4];
    const __m128i shifted = x % 4 == 0   ? above
                            : x % 4 == 1 ? _mm_srli_si128(above, 4)
                            : x % 4 == 2 ? _mm_srli_si128(above, 8)
                                         : _mm_srli_si128(above, 12);
    const __m128i of_first = _mm_and_si128(shifted, _mm_cvtsi32_si128(-1));
    const Lanes all_above = one_row_down<2>(left_) | reinterpret_cast<Lanes>(of_first);
    return reinterpret_cast<__m128i>(unfiltered(reinterpret_cast<Lanes>(raw), all_above));
  }
  static __m128i load(const uint8_t* from) {
    return _mm_loadu_si128(reinterpret_cast<const __m128i*>(from));
  }
  static void store(uint8_t* to, __m128i v) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), v);
  }
#endif

  // By Paeth's rule, of which the others are cases: on the left where nothing is above, above where nothing is left.
  Lanes unfiltered(Lanes raw, Lanes above) {
    const Lanes mean = ((left_ + above) >> 1) & by_mean_;
    const Lanes left = left_ & by_left_, up = above & by_above_, corner = above_left_ & by_all_;
    const Lanes from_left = distance(up, corner), from_up = distance(left, corner);
    const Lanes from_corner = distance(left + up, corner + corner);
    const Lanes nearest = from_up < from_corner ? from_up : from_corner;
    const Lanes nearer = from_up <= from_corner ? up : corner;
    above_left_ = above;
    left_ = (raw + ((from_left <= nearest ? left : nearer) | mean)) & 255;
    return left_;
  }

  uint8_t* const first_;
  const size_t pitch_;
  Lanes by_left_{}, by_above_{}, by_mean_{}, by_all_{};
  Lanes left_{}, above_left_{};
#if defined(__SSE2__)
  __m128i tile_[4], above_[2];
#endif
};

// Two groups at once, the second one behind the first: the processor works at one while it waits for the other.
template <int bpp>
void unfilter_rows(uint8_t* first, size_t pitch, int width) {
  constexpr int kRows = RowGroup<bpp>::kRows;
  constexpr int kBehind = 3 * kRows;  // [px] so that of eight pixels all above are done before the eight begin
  RowGroup<bpp> upper(first, pitch), lower(first + kRows * pitch, pitch);
  const auto step = [&](int x, const auto& exists) {
    upper.step(x, exists);
    lower.step(x - kBehind, exists);
  };
  const auto checked = [width](int x) { return x >= 0 && x < width; };
  int x = 0;
  for (; x < kBehind + kRows - 1; ++x) step(x, checked);
#if defined(__SSE2__)
  if constexpr (bpp == 2)
    for (; x + 8 <= width; x += 8) {
      upper.take_eight(x), lower.take_eight(x - kBehind);
      upper.template step_twice<0>(), lower.template step_twice<0>();
      upper.template step_twice<1>(), lower.template step_twice<1>();
      upper.template step_twice<2>(), lower.template step_twice<2>();
      upper.template step_twice<3>(), lower.template step_twice<3>();
      upper.give_eight(x), lower.give_eight(x - kBehind);
    }
#endif
  for (; x < width; ++x) step(x, [](int) { return true; });
  for (; x < width + kBehind + kRows - 1; ++x) step(x, checked);
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
