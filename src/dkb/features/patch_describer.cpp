// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/patch_describer.h"

#include <algorithm>
#include <cmath>

#include "dkb/features/orientation.h"

namespace dkb {
namespace {

constexpr int kMargin = std::max(kBriefRadius + kBlurRadius, kOrientationRadius + 1) + 1;  // [px] and one to each side

}  // namespace

const GreyImage& PatchDescriber::blurred(int level) {
  blurred_.resize(static_cast<size_t>(pyramid_.levels()));
  GreyImage& image = blurred_[static_cast<size_t>(level)];
  if (image.empty()) blur_.apply(pyramid_.level(level), image);
  return image;
}

std::optional<int> PatchDescriber::distance(float x, float y, int octave, const Descriptor& sought) {
  if (octave < 0 || octave >= pyramid_.levels()) return std::nullopt;
  const GreyImage& pixels = pyramid_.level(octave);
  const double column = std::round(pyramid_.level_x(octave, x)), line = std::round(pyramid_.level_y(octave, y));
  if (!(column >= kMargin && line >= kMargin && column < pixels.width() - kMargin && line < pixels.height() - kMargin))
    return std::nullopt;
  const int cx = static_cast<int>(column), cy = static_cast<int>(line);
  const GreyImage& smooth = blurred(octave);
  int min_distance = 256;
  for (int py = cy - 1; py <= cy + 1; ++py)
    for (int px = cx - 1; px <= cx + 1; ++px) {
      const float angle = orientation_angle(centroid_moments(pixels.row(py) + px, pixels.width()));
      min_distance =
          std::min(min_distance, hamming_distance(sought, brief_.describe(smooth.row(py) + px, pixels.width(), angle)));
    }
  return min_distance;
}

}  // namespace dkb
