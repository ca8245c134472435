// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/orb_extractor.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <string>
#include <utility>

#include "dkb/features/orientation.h"
#include "dkb/features/subpixel.h"
#include "dkb/util/errors.h"

namespace dkb {

OrbExtractor::OrbExtractor(OrbOptions options, Simd simd, bool threaded)
    : options_(options),
      simd_(simd),
      pyramid_({.levels = options.levels, .scale = options.scale}, simd),
      brief_(simd),
      worker_(simd),
      other_worker_(simd),
      beside_(
          "feature extraction", [this] { take_levels(other_worker_); }, threaded) {}

void OrbExtractor::each_level(LevelStep step, const auto& before) {
  step_ = step;
  next_level_ = 0;
  beside_.begin();
  before();
  take_levels(worker_);
  beside_.finish();
}

// Each level is taken by one thread, the large ones first. What it makes has a place of its own.
void OrbExtractor::take_levels(Worker& worker) {
  for (int level = next_level_++; level < pyramid_.levels(); level = next_level_++) {
    for (int built = levels_built_; built <= level; built = levels_built_) levels_built_.wait(built);
    (this->*step_)(level, worker);
  }
}

void OrbExtractor::leave_out(const Image<uint8_t>& mask) {
  left_out_ = mask.empty() ? Image<int>() : Image<int>(mask.width() + 1, mask.height() + 1);
  for (int y = 0; y < mask.height(); ++y)
    for (int x = 0; x < mask.width(); ++x)
      left_out_(x + 1, y + 1) = left_out_(x, y + 1) + left_out_(x + 1, y) - left_out_(x, y) + (mask(x, y) != 0);
}

bool OrbExtractor::reaches_into_left_out(int level, const PixelCorner& c) const {
  const auto first = [](double full) { return std::max(0, static_cast<int>(std::floor(full))); };
  const auto end = [](double full, int size) { return std::min(static_cast<int>(std::ceil(full)) + 1, size - 1); };
  const int left = first(pyramid_.full_x(level, c.x - kFastRadius)),
            top = first(pyramid_.full_y(level, c.y - kFastRadius)),
            right = end(pyramid_.full_x(level, c.x + kFastRadius), left_out_.width()),
            bottom = end(pyramid_.full_y(level, c.y + kFastRadius), left_out_.height());
  return left_out_(right, bottom) - left_out_(left, bottom) - left_out_(right, top) + left_out_(left, top) > 0;
}

void OrbExtractor::find_corners(int level, Worker& worker) {
  auto& corners = corners_[static_cast<size_t>(level)];
  const GreyImage& pixels = pyramid_.level(level);
  worker.finder.find(pixels, options_.fast_threshold_min, kOrbBorder, corners);
  if (!left_out_.empty()) std::erase_if(corners, [&](const PixelCorner& c) { return reaches_into_left_out(level, c); });
  worker.spread.drop_weak(orb_region(pixels), options_.fast_threshold, kOrbCellSize, corners);
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

void OrbExtractor::describe_corners(int level, Worker& worker) {
  const auto i = static_cast<size_t>(level);
  const GreyImage& pixels = pyramid_.level(level);
  std::vector<PixelCorner>& corners = corners_[i];
  worker.spread.keep(orb_region(pixels), quotas_[i], corners);
  if (!poor_quotas_.empty()) {
    worker.spread.keep(orb_region(pixels), poor_quotas_[i], poor_corners_[i]);
    corners.insert(corners.end(), poor_corners_[i].begin(), poor_corners_[i].end());
  }
  if (corners.empty()) return;
  GreyImage& blurred = blurred_[i];
  worker.blur.apply(pixels, blurred);
  size_t at = firsts_[i];
  for (const PixelCorner& pixel : corners) {
    Corner& corner = features_.corners[at];
    corner.angle = orientation_angle(centroid_moments(pixels.row(pixel.y) + pixel.x, pixels.width(), simd_));
    const SubpixelOffset offset = refine_corner(pixels, pixel.x, pixel.y, simd_);
    corner.x = static_cast<float>(pyramid_.full_x(level, pixel.x + offset.x));
    corner.y = static_cast<float>(pyramid_.full_y(level, pixel.y + offset.y));
    corner.place_sigma = offset.sigma * static_cast<float>(pyramid_.scale_x(level));
    corner.response = pixel.score;
    corner.octave = static_cast<uint8_t>(level);
    features_.descriptors[at++] = brief_.describe(blurred.row(pixel.y) + pixel.x, pixels.width(), corner.angle);
  }
}

OrbFeatures OrbExtractor::extract(const GreyImage& image, const Image<uint8_t>& poor, int cell) {
  if (image.width() > 32767 || image.height() > 32767)
    throw InputError("feature extraction: the image is " + std::to_string(image.width()) + " x " +
                     std::to_string(image.height()) + " pixels; at most 32767 per side are possible");
  pyramid_.start(image);
  const auto levels = static_cast<size_t>(pyramid_.levels());
  corners_.resize(levels);
  blurred_.resize(levels);
  levels_built_ = 1;
  each_level(&OrbExtractor::find_corners, [this] {
    for (int level = 1; level < pyramid_.levels(); ++level) {
      pyramid_.build_level(level);
      levels_built_ = level + 1;
      levels_built_.notify_one();
    }
  });

  poor_quotas_.clear();
  if (poor.empty()) {
    quotas_ = quotas(corners_, options_.count);
  } else {
    split_corners(poor, cell);
    const auto number = [](const auto& of_levels) {
      size_t sum = 0;
      for (const auto& corners : of_levels) sum += corners.size();
      return static_cast<int>(sum);
    };
    // The poor place keeps what it has when the others cannot use their half.
    const int half = std::min(number(corners_), (options_.count + 1) / 2);
    poor_quotas_ = quotas(poor_corners_, options_.count - half);
    quotas_ = quotas(corners_, options_.count - std::accumulate(poor_quotas_.begin(), poor_quotas_.end(), 0));
  }
  firsts_.assign(levels, 0);
  size_t count = 0;
  for (size_t i = 0; i < levels; ++i) {
    firsts_[i] = count;
    count += static_cast<size_t>(quotas_[i] + (poor_quotas_.empty() ? 0 : poor_quotas_[i]));
  }
  features_.corners.resize(count);
  features_.descriptors.resize(count);
  each_level(&OrbExtractor::describe_corners, [] {});
  return std::exchange(features_, {});
}

}  // namespace dkb
