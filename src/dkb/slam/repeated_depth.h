// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <memory>
#include <string>
#include <utility>

#include "dkb/image/rgbd_image.h"
#include "dkb_slam/frame.h"

namespace dkb {

// Drivers give the last depth image again, under a new stamp, when no other has come: colour at 30 Hz with depth at 15
// or depth that hangs. A sensor's noise makes no two images the same, so that it is known for what it is; its depths
// are those of another moment, and it says that nothing has moved. Deterministic.
class RepeatedDepth {
 public:
  // The frame, without its depth where that is the one of the frame before and colour is not. In a simulation without
  // noise depth may be the same all the same: where the camera stands still, as colour is then, and along a wall that
  // it faces, where all depths are one.
  Frame left_out(const Frame& frame) {
    const std::shared_ptr<const RgbdImage> before = std::exchange(last_, frame.image());
    repeats_ = before && before->depth == last_->depth && before->grey != last_->grey && !flat(last_->depth);
    if (!repeats_) return frame;
    auto image = std::make_shared<RgbdImage>(*last_);
    image->depth = DepthImage(image->depth.width(), image->depth.height());
    Frame without(std::move(image), frame.stamp_ns(), frame.depth_stamp_ns());
    without.set_prior(frame.prior());
    return without;
  }
  // What to tell the user, once.
  std::string take_warning() {
    if (!repeats_ || std::exchange(told_, true)) return "";
    return "the depth image is the one of the frame before once more, with another colour image: such frames are used "
           "without their depth; give each depth image once, or colour at the rate of depth";
  }

 private:
  static bool flat(const DepthImage& depth) {
    return std::all_of(depth.data(), depth.data() + depth.size(), [&](float z) { return z == depth.data()[0]; });
  }

  std::shared_ptr<const RgbdImage> last_;  // as it was given
  bool repeats_ = false, told_ = false;
};

}  // namespace dkb
