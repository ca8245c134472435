// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <vector>

#include "dkb/dynamics/still_cells.h"
#include "dkb/features/image_pyramid.h"
#include "dkb/image/rgbd_image.h"
#include "dkb/map/ids.h"

namespace dkb {

// What is kept of a frame so that detections can be carried from it and flow measured to it.
struct PastFrame {
  FrameIndex frame = 0;
  std::shared_ptr<const RgbdImage> image;
  std::shared_ptr<const ImagePyramid> pyramid;
  std::vector<Eigen::Vector2f> corners;  // [px] of the image as read
  StillCells still;                      // when it became a keyframe; empty without motion segmentation
  bool keyframe = false;
};
using PastFrames = std::deque<PastFrame>;  // newest last

}  // namespace dkb
