// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include "dkb/features/corner_spread.h"
#include "dkb/features/fast_corners.h"
#include "dkb/features/features.h"
#include "dkb/features/gaussian_blur.h"
#include "dkb/features/image_pyramid.h"
#include "dkb/features/simd.h"
#include "dkb/features/steered_brief.h"
#include "dkb/image/image.h"
#include "dkb/util/side_task.h"

namespace dkb {

constexpr int kOrbCellSize = 32;  // [px of the level] in which the threshold adapts
constexpr int kOrbBorder =
    kBriefRadius + kBlurRadius + 1;  // [px of the level] without corners: what a descriptor reaches

// The part of a pyramid level that corners may lie in.
inline CornerRegion orb_region(const GreyImage& level) {
  return {kOrbBorder, kOrbBorder, level.width() - kOrbBorder, level.height() - kOrbBorder};
}

struct OrbOptions {
  int count = 1000;            // features asked for, >= 1; fewer come where the image has no more corners
  double scale = 1.2;          // size of a pyramid level over that of the next, (1, 4]
  int levels = 8;              // pyramid levels, 1 ... 16
  int fast_threshold = 20;     // [grey levels] corner contrast, fast_threshold_min ... 254
  int fast_threshold_min = 7;  // [grey levels] used in cells where the first finds nothing, >= 1
};

// Oriented FAST corners with rotated BRIEF descriptors on an image pyramid (Rublee et al., ICCV 2011), spread evenly
// over the image and, by area, over the levels. Keeps its buffers from frame to frame; one object per thread.
// Deterministic: the same image gives the same features, on every processor, with and without a thread beside.
class OrbExtractor {
 public:
  // `threaded`: a thread of its own takes a share of the levels.
  explicit OrbExtractor(OrbOptions options = {}, Simd simd = best_simd(), bool threaded = false);

  // Features ordered by level, finest first. Throws InputError for an empty image or one with a side above 32767.
  // `poor`: 255 in the square cells of `cell` px where features are of little use, such as on people who fill the
  // image; these get half of the features at most where there are enough others. Empty: no such place.
  OrbFeatures extract(const GreyImage& image, const Image<uint8_t>& poor = {}, int cell = 1);
  // Places without corners from the next image on, which has the size of `mask`: above 0. A corner lies there where its
  // circle does. Empty: no such place.
  void leave_out(const Image<uint8_t>& mask);
  // Features asked for from now on.
  void set_count(int count) { options_.count = count; }
  // Pyramid of the last image given to extract().
  const ImagePyramid& pyramid() const { return pyramid_; }
  const SteeredBrief& brief() const { return brief_; }

 private:
  // What one thread keeps its buffers in.
  struct Worker {
    explicit Worker(Simd simd) : finder(simd), blur(simd) {}
    FastCornerFinder finder;
    CornerSpread spread;
    GaussianBlur blur;
  };
  using LevelStep = void (OrbExtractor::*)(int level, Worker& worker);

  // `step` for every level, by both threads; `before` is done first by the one that calls.
  void each_level(LevelStep step, const auto& before);
  void take_levels(Worker& worker);
  // Whether the square around a corner's circle does.
  bool reaches_into_left_out(int level, const PixelCorner& c) const;
  void find_corners(int level, Worker& worker);
  void describe_corners(int level, Worker& worker);
  // How many of each level's corners to keep, `count` in all: by area, what a level lacks goes to the others.
  std::vector<int> quotas(const std::vector<std::vector<PixelCorner>>& corners, int count) const;
  void split_corners(const Image<uint8_t>& poor, int cell);

  OrbOptions options_;
  Simd simd_;
  ImagePyramid pyramid_;
  SteeredBrief brief_;
  std::vector<std::vector<PixelCorner>> corners_, poor_corners_;  // per level
  std::vector<int> quotas_, poor_quotas_;                         // per level
  Image<int> left_out_;             // how many pixels of the mask are above and left of each; empty without a mask
  std::vector<GreyImage> blurred_;  // per level
  std::vector<size_t> firsts_;      // of each level in `features_`
  OrbFeatures features_;

  LevelStep step_ = nullptr;
  std::atomic<int> next_level_ = 0;    // that nobody works at
  std::atomic<int> levels_built_ = 0;  // of the pyramid
  Worker worker_, other_worker_;
  SideTask beside_;  // last: its thread ends first
};

}  // namespace dkb
