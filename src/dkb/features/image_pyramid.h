// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/features/simd.h"
#include "dkb/image/image.h"

namespace dkb {

struct ImagePyramidOptions {
  int levels = 8;      // levels including the full-resolution one, 1 ... 16
  double scale = 1.2;  // size of a level over that of the next coarser one, (1, 4]
  int min_size = 8;    // [px] levels with a smaller side are not built; >= 1
  void check() const;  // throws InvalidOption
};

// Grey images of falling resolution. Level 0 is a copy of the image; each further level is made from the one above it
// by bilinear interpolation in fixed point. Its size is that of level 0 over scale^level, rounded. Outer edges of all
// levels coincide, so positions map between levels by (x + 0.5) * width ratio - 0.5. build() may be called for frame
// after frame; buffers are kept while the size stays the same.
class ImagePyramid {
 public:
  explicit ImagePyramid(ImagePyramidOptions options = {}, Simd simd = best_simd());

  // Throws InputError for an empty image.
  void build(const GreyImage& image);
  // The same step by step: the image itself, then levels 1 ... levels() - 1 in order. Who makes a level on one thread
  // may read those above it on others.
  void start(const GreyImage& image);
  void build_level(int index);

  // Levels built; less than asked for when the image is small. 0 before the first build().
  int levels() const { return static_cast<int>(images_.size()); }
  const GreyImage& level(int index) const { return images_[static_cast<size_t>(index)]; }

  // Size of level 0 over that of level `index`, by its rounded width and height.
  double scale_x(int index) const { return scales_[static_cast<size_t>(index)].x; }
  double scale_y(int index) const { return scales_[static_cast<size_t>(index)].y; }
  // Full-resolution position [px] of a position on a level, and back.
  double full_x(int index, double x) const { return (x + 0.5) * scale_x(index) - 0.5; }
  double full_y(int index, double y) const { return (y + 0.5) * scale_y(index) - 0.5; }
  double level_x(int index, double x) const { return (x + 0.5) / scale_x(index) - 0.5; }
  double level_y(int index, double y) const { return (y + 0.5) / scale_y(index) - 0.5; }

 private:
  struct Tap {
    int32_t index = 0;   // first of the two source pixels
    int32_t weight = 0;  // of the second one, in 1 / 128 (rows) or 1 / 2048 (columns)
  };
  // Interpolation from one level to the next.
  struct Resampling {
    std::vector<Tap> rows, columns;
    // For the vector kernels, two numbers per output pixel: its source columns, relative to the first of the group
    // that it is worked at with, and their weights. Groups of 4 by AVX2 (of bytes), of 16 by AVX-512 (of columns).
    std::vector<int32_t> group_start, wide_start;
    std::vector<uint8_t> shuffles;
    std::vector<uint16_t> wide_columns;
    std::vector<int16_t> weights;
    Simd simd = Simd::scalar;  // the best that can do it: groups must not reach farther than one register does

    // A row of the next level from two of this one, blended.
    void interpolate(const int16_t* blended, uint8_t* out) const;
    // The first columns of it, in whole groups; return how many.
    size_t interpolate_avx2(const int16_t* blended, uint8_t* out) const;
    size_t interpolate_avx512(const int16_t* blended, uint8_t* out) const;
  };
  struct Scale {
    double x = 1, y = 1;
  };

  void plan(int width, int height);
  static std::vector<Tap> make_taps(int source, int target, int one);
  static Resampling make_resampling(int width, int height, int next_width, int next_height, Simd simd);

  ImagePyramidOptions options_;
  Simd simd_;
  std::vector<GreyImage> images_;
  std::vector<Resampling> resamplings_;  // [i]: from level i to i + 1
  std::vector<Scale> scales_;
  std::vector<int16_t> row_buffer_;
};

}  // namespace dkb
