// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "dkb_slam/image.h"

namespace dkb {

// The colours of the pixels that a sensor saw through a mosaic of filters. `pattern` names the filters of the first two
// pixels of the first two rows: rggb, bggr, gbrg or grbg. What a pixel did not see is the mean of its neighbours that
// did. `mosaic` has width x height bytes, `stride` bytes from a row to the next; both sides at least 2 px.
ColourImage demosaiced(const uint8_t* mosaic, int width, int height, size_t stride, std::string_view pattern);

}  // namespace dkb
