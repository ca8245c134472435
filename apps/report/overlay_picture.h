// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dkb_slam/frame.h"

namespace dkb::report {

// A frame's image, about 320 px wide, and what lies over it.
struct OverlayPicture {
  struct Mark {
    int16_t x = 0, y = 0;  // [px] of the picture
    FeatureState state = FeatureState::unused;
  };
  size_t row = 0;
  int width = 0, height = 0;  // [px]
  double scale = 1;           // picture over image
  std::string jpeg;
  std::vector<Mark> marks;
  MoverMask mask;                // of the image
  std::vector<Detection> boxes;  // likewise
};

OverlayPicture take_picture(size_t row, const Frame& frame, const FrameResult& result);

// The picture as SVG inside HTML: features by state, told apart by shape and colour, movers tinted, boxes drawn.
std::string overlay_svg(const OverlayPicture& picture, const std::string& description);

std::string base64(const std::string& bytes);

}  // namespace dkb::report
