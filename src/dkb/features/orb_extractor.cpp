// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/orb_extractor.h"

#include <algorithm>
#include <functional>
#include <string>

#include "dkb/features/orientation.h"
#include "dkb/features/subpixel.h"
#include "dkb/util/errors.h"

namespace dkb {

OrbExtractor::OrbExtractor(OrbOptions options, Simd simd)
    : options_(options),
      simd_(simd),
      pyramid_({.levels = options.levels, .scale = options.scale}, simd),
      finder_(simd),
      blur_(simd),
      brief_(simd) {}

CornerRegion OrbExtractor::region(int level) const {
  const GreyImage& image = pyramid_.level(level);
  return {kOrbBorder, kOrbBorder, image.width() - kOrbBorder, image.height() - kOrbBorder};
}

void OrbExtractor::find_corners() {
  const size_t levels = static_cast<size_t>(pyramid_.levels());
  corners_.resize(levels);
  for (size_t i = 0; i < levels; ++i) {
    const int level = static_cast<int>(i);
    finder_.find(pyramid_.level(level), options_.fast_threshold_min, kOrbBorder, corners_[i]);
    spread_.drop_weak(region(level), options_.fast_threshold, kOrbCellSize, corners_[i]);
  }
}

std::vector<int> OrbExtractor::quotas(const std::vector<std::vector<PixelCorner>>& corners, int count) const {
  std::vector<int> quotas(corners.size(), 0);
  int left = count;
  for (bool full = false; left > 0 && !full;) {
    // Share what is left among the levels that still have corners, in proportion to their area.
    double area = 0;
    for (size_t i = 0; i < corners.size(); ++i)
      if (quotas[i] < static_cast<int>(corners[i].size()))
        area += static_cast<double>(pyramid_.level(static_cast<int>(i)).size());
    full = true;
    const int shared = left;
    for (size_t i = 0; i < corners.size() && left > 0; ++i) {
      const int room = static_cast<int>(corners[i].size()) - quotas[i];
      if (room <= 0) continue;
      const double share = shared * static_cast<double>(pyramid_.level(static_cast<int>(i)).size()) / area;
      const int given = std::min({room, left, std::max(1, static_cast<int>(share + 0.5))});
      quotas[i] += given;
      left -= given;
      full = false;
    }
  }
  return quotas;
}

void OrbExtractor::split_corners(const Image<uint8_t>& poor, int cell) {
  poor_corners_.resize(corners_.size());
  for (size_t i = 0; i < corners_.size(); ++i) {
    const int level = static_cast<int>(i);
    const auto on_poor = [&](const PixelCorner& c) {
      const int x = static_cast<int>(pyramid_.full_x(level, c.x)) / cell,
                y = static_cast<int>(pyramid_.full_y(level, c.y)) / cell;
      return poor.contains(x, y) && poor(x, y) != 0;
    };
    const auto middle = std::stable_partition(corners_[i].begin(), corners_[i].end(), std::not_fn(on_poor));
    poor_corners_[i].assign(middle, corners_[i].end());
    corners_[i].erase(middle, corners_[i].end());
  }
}

// Keeps `count` of all levels' corners and returns how many there are now.
int OrbExtractor::keep(std::vector<std::vector<PixelCorner>>& corners, int count) {
  const std::vector<int> quota = quotas(corners, count);
  int kept = 0;
  for (size_t i = 0; i < corners.size(); ++i) {
    if (!corners[i].empty()) spread_.keep(region(static_cast<int>(i)), quota[i], corners[i]);
    kept += static_cast<int>(corners[i].size());
  }
  return kept;
}

OrbFeatures OrbExtractor::extract(const GreyImage& image, const Image<uint8_t>& poor, int cell) {
  if (image.width() > 65535 || image.height() > 65535)
    throw InputError("feature extraction: the image is " + std::to_string(image.width()) + " x " +
                     std::to_string(image.height()) + " pixels; at most 65535 per side are possible");
  pyramid_.build(image);
  find_corners();
  if (poor.empty()) {
    keep(corners_, options_.count);
  } else {
    split_corners(poor, cell);
    size_t rich = 0;
    for (const auto& corners : corners_) rich += corners.size();
    // The poor place keeps what it has when the others cannot use their half.
    const int half = static_cast<int>(std::min(rich, static_cast<size_t>(options_.count + 1) / 2));
    const int kept = keep(poor_corners_, options_.count - half);
    keep(corners_, options_.count - kept);
    for (size_t i = 0; i < corners_.size(); ++i)
      corners_[i].insert(corners_[i].end(), poor_corners_[i].begin(), poor_corners_[i].end());
  }
  blurred_.resize(corners_.size());
  OrbFeatures features;
  features.corners.reserve(static_cast<size_t>(options_.count));
  features.descriptors.reserve(static_cast<size_t>(options_.count));
  for (size_t i = 0; i < corners_.size(); ++i) {
    const int level = static_cast<int>(i);
    const std::vector<PixelCorner>& corners = corners_[i];
    if (corners.empty()) continue;
    const GreyImage& pixels = pyramid_.level(level);
    GreyImage& blurred = blurred_[i];
    blur_.apply(pixels, blurred);
    for (const PixelCorner& pixel : corners) {
      Corner corner;
      corner.angle = orientation_angle(centroid_moments(pixels.row(pixel.y) + pixel.x, pixels.width(), simd_));
      const SubpixelOffset offset =
          options_.subpixel ? refine_corner(pixels, pixel.x, pixel.y, simd_) : SubpixelOffset{};
      corner.x = static_cast<float>(pyramid_.full_x(level, pixel.x + offset.x));
      corner.y = static_cast<float>(pyramid_.full_y(level, pixel.y + offset.y));
      corner.place_sigma = offset.sigma * static_cast<float>(pyramid_.scale_x(level));
      corner.response = pixel.score;
      corner.octave = static_cast<uint8_t>(level);
      features.corners.push_back(corner);
      features.descriptors.push_back(brief_.describe(blurred.row(pixel.y) + pixel.x, pixels.width(), corner.angle));
    }
  }
  return features;
}

}  // namespace dkb
