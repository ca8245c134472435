// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/image_appearance.h"

#include <cmath>

namespace dkb {

std::optional<bool> ImageAppearance::same(const Eigen::Vector2d& pixel, double depth, int octave,
                                          const Descriptor& descriptor) {
  constexpr int kSameBits = 80, kOtherBits = 100;  // two random descriptors differ by 128
  constexpr double kDepthGate = 0.07;              // [1] relative
  const Eigen::Vector2f at = undistort_.image_pixel(pixel);
  const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
  if (!image_.depth.contains(x, y) || !(image_.depth(x, y) > 0)) return std::nullopt;
  const double seen = image_.depth(x, y);
  if (seen < (1 - kDepthGate) * depth) return std::nullopt;  // something stands before it
  if (seen > (1 + kDepthGate) * depth) return false;         // it is not there
  if (!describer_) describer_.emplace(pyramid_).set_image(image_.grey);
  const auto bits = describer_->distance(at.x(), at.y(), octave, descriptor);
  if (!bits || (*bits > kSameBits && *bits < kOtherBits)) return std::nullopt;
  return *bits <= kSameBits;
}

}  // namespace dkb
