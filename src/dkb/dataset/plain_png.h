// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace dkb::formats {

// Pixels of the PNG files that datasets are made of: 8-bit grey, 8-bit RGB and 16-bit grey in the machine's byte order,
// not interlaced, without transparency. Several times as fast as libpng, with the same pixels. False, and `out` in any
// state, for a file of another kind, one that is broken in any way, and in a build without libdeflate: libpng reads
// the one and tells what is wrong with the other.
// `out`: height rows of width * bytes_per_pixel bytes; 1, 2 and 3 stand for the kinds above.
bool decode_plain_png(std::string_view bytes, int width, int height, int bytes_per_pixel, uint8_t* out);

}  // namespace dkb::formats
