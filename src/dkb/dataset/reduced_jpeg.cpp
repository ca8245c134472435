// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/reduced_jpeg.h"

#include <algorithm>
#include <cstdint>
#include <vector>

#include "dkb/dataset/image_codecs.h"

namespace dkb {
namespace {

// `Pixel`: of single bytes.
template <class Pixel>
std::string reduced(const ImageView& image, int factor, int quality) {
  constexpr int channels = sizeof(Pixel);
  Image<Pixel> small(image.width / factor, image.height / factor);
  std::vector<uint16_t> column(image.row_bytes());
  // Multiplied in the place of divided: exact, since a sum is less than 2^32 / area.
  const auto area = static_cast<uint64_t>(factor) * static_cast<uint64_t>(factor);
  const uint64_t share = ((uint64_t{1} << 32) + area - 1) / area;
  auto* to = reinterpret_cast<uint8_t*>(small.data());
  for (int y = 0; y < small.height(); ++y) {
    std::fill(column.begin(), column.end(), uint16_t{0});
    for (int dy = 0; dy < factor; ++dy) {
      const uint8_t* in = image.row(y * factor + dy);
      for (size_t i = 0; i < column.size(); ++i) column[i] = static_cast<uint16_t>(column[i] + in[i]);
    }
    for (int x = 0; x < small.width(); ++x)
      for (int c = 0; c < channels; ++c) {
        uint32_t sum = 0;
        for (int dx = 0; dx < factor; ++dx) sum += column[static_cast<size_t>((x * factor + dx) * channels + c)];
        *to++ = static_cast<uint8_t>(sum * share >> 32);
      }
  }
  return encode_jpeg(small, quality);
}

}  // namespace

std::string reduced_jpeg(const Frame& frame, int factor, int quality) {
  if (frame.empty()) return {};
  if (const ImageView colour = frame.colour(); !colour.empty()) return reduced<Rgb>(colour, factor, quality);
  const ImageView grey = frame.grey();
  return grey.empty() ? std::string() : reduced<uint8_t>(grey, factor, quality);
}

}  // namespace dkb
