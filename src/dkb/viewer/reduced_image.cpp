// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/reduced_image.h"

#include <algorithm>

#include "dkb/dataset/image_codecs.h"

namespace dkb {
namespace {

constexpr int kWidth = 320, kQuality = 75;
constexpr float kFar = 6;  // [m] drawn darkest

int step_of(const ImageView& view) {
  return std::max(1, view.width / kWidth);
}

// Mean of each square of step x step pixels of one channel.
uint8_t mean(const ImageView& view, int x, int y, int step, int channels, int channel) {
  int sum = 0;
  for (int dy = 0; dy < step; ++dy) {
    const uint8_t* row = view.row(y * step + dy) + x * step * channels + channel;
    for (int dx = 0; dx < step; ++dx) sum += row[dx * channels];
  }
  return static_cast<uint8_t>(sum / (step * step));
}

}  // namespace

std::string reduced_picture(const Frame& frame) {
  if (frame.empty()) return {};
  if (const ImageView colour = frame.colour(); !colour.empty()) {
    const int step = step_of(colour);
    ColourImage small(colour.width / step, colour.height / step);
    for (int y = 0; y < small.height(); ++y)
      for (int x = 0; x < small.width(); ++x)
        small(x, y) = {mean(colour, x, y, step, 3, 0), mean(colour, x, y, step, 3, 1), mean(colour, x, y, step, 3, 2)};
    return encode_jpeg(small, kQuality);
  }
  const ImageView grey = frame.grey();
  if (grey.empty()) return {};
  const int step = step_of(grey);
  GreyImage small(grey.width / step, grey.height / step);
  for (int y = 0; y < small.height(); ++y)
    for (int x = 0; x < small.width(); ++x) small(x, y) = mean(grey, x, y, step, 1, 0);
  return encode_jpeg(small, kQuality);
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
