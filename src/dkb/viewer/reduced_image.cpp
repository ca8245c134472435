// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/reduced_image.h"

#include <algorithm>

#include "dkb/dataset/image_codecs.h"
#include "dkb/dataset/reduced_jpeg.h"

namespace dkb {
namespace {

constexpr int kWidth = 320, kQuality = 75;
constexpr float kFar = 6;  // [m] drawn darkest

int step_of(const ImageView& view) {
  return std::max(1, view.width / kWidth);
}

}  // namespace

std::string reduced_picture(const Frame& frame) {
  if (frame.empty()) return {};
  return reduced_jpeg(frame, step_of(frame.colour().empty() ? frame.grey() : frame.colour()), kQuality);
}

std::string reduced_depth(const Frame& frame) {
  const ImageView depth = frame.empty() ? ImageView{} : frame.depth();
  if (depth.empty()) return {};
  const int step = step_of(depth);
  GreyImage small(depth.width / step, depth.height / step);
  for (int y = 0; y < small.height(); ++y) {
    const auto* row = reinterpret_cast<const float*>(depth.row(y * step));
    for (int x = 0; x < small.width(); ++x) {
      const float z = row[x * step];
      small(x, y) = z > 0 ? static_cast<uint8_t>(255 - 225 * std::min(z, kFar) / kFar) : 0;
    }
  }
  return encode_jpeg(small, kQuality);
}

}  // namespace dkb
