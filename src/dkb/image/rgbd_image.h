// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>

#include "dkb/image/image.h"
#include "dkb_slam/frame.h"

namespace dkb {

// One pair of a colour (or grey) and a depth image of the same size, registered to the colour camera.
// Cheap to move, expensive to copy; passed as shared_ptr<const RgbdImage> between threads.
struct RgbdImage {
  double timestamp = 0;        // [s] of the colour image, middle of the exposure
  double depth_timestamp = 0;  // [s] of the depth image, as it is stamped
  GreyImage grey;              // always there
  ColourImage colour;          // empty for grey cameras
  DepthImage depth;            // [m], 0 = no data; same size as grey

  // [s] When the colour camera saw what the depth image shows.
  double depth_time(const Camera& camera) const { return depth_timestamp + camera.depth_time_offset; }
};

// Whether it tells anything.
inline bool has_depth(const DepthImage& image) {
  return std::any_of(image.data(), image.data() + image.size(), [](float z) { return z > 0; });
}

// What a detector is shown of a frame, which must outlive it.
DetectorInput detector_input(const Frame& frame);

}  // namespace dkb
