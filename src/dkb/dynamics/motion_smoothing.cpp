// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_smoothing.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/features/vectorised.h"

namespace dkb {
namespace {

constexpr double kDistance = 0.4;  // [m] along the surface over which cells of one object speak for each other
constexpr int kArm = 3;  // [cells] far enough for a fold to rise above the noise, near enough for a foot or a hand
constexpr float kCrease = 0.525f;       // difference of slopes, of inverse depth over the ray, in a fold ...
constexpr float kCreaseNoise = 0.005f;  // [1/m] ... that stands out of the noise of second differences of inverse depth
constexpr float kCreaseLink = 0.3f;     // share of what is said that crosses such a fold

}  // namespace

MotionSmoothing::MotionSmoothing(const CameraModel& camera, const SensorNoise& noise, int cell, Simd simd)
    : noise_(noise),
      simd_(simd),
      focal_(camera.fx),
      cell_(cell),
      fade_(static_cast<float>(std::sqrt(2.0) * cell / (camera.fx * kDistance))),
      crease_(std::max(kCrease * kArm * static_cast<float>(cell / camera.fx), kCreaseNoise)) {
  const int width = (camera.width + cell - 1) / cell, height = (camera.height + cell - 1) / cell;
  for (Image<float>* i : {&inverse_, &damping_, &left_, &up_}) *i = Image<float>(width, height);
}

void MotionSmoothing::find_creases(const Image<float>& depth) {
  const int width = depth.width(), height = depth.height();
  for (size_t i = 0; i < depth.size(); ++i) inverse_.data()[i] = depth.data()[i] > 0 ? 1.0f / depth.data()[i] : 0.0f;
  for (int y = 0; y < height; ++y) {
    const float* here = inverse_.row(y);
    float* out = damping_.row(y);
    std::fill(out, out + width, 1.0f);
    const auto mark = [&](const float* before, const float* after, int begin, int end) {
      for (int x = begin; x < end; ++x) {
        const float bend = before[x] + after[x] - 2.0f * here[x];
        const bool known = (before[x] > 0) & (after[x] > 0);
        out[x] = (known & (bend > crease_)) ? kCreaseLink : out[x];
      }
    };
    mark(here - kArm, here + kArm, kArm, width - kArm);
    if (y >= kArm && y + kArm < height) mark(inverse_.row(y - kArm), inverse_.row(y + kArm), 0, width);
  }
}

void MotionSmoothing::set_surface(const Image<float>& depth) {
  find_creases(depth);
  // Link of each cell from `first` on to the one `step` cells before it.
  const auto link = [&](size_t first, size_t step, Image<float>& links) {
    run_vectorised(
        simd_, [first, step, count = depth.size(), depth = depth.data(), damping = damping_.data(),
                links = links.data(), noise = noise_, cell = cell_, focal = focal_, fade = fade_]() DKB_KERNEL_BODY {
          for (size_t i = first; i < count; ++i) {
            const size_t k = i - step;
            const float za = depth[i], zb = depth[k];
            const float low = std::min(za, zb), high = std::max(za, zb);
            const bool joined = (low > 0) & (high - low < static_cast<float>(noise.max_depth_jump(low, cell, focal)));
            links[i] = joined ? std::min(damping[i], damping[k]) / (1.0f + fade * high) : 0.0f;
          }
        });
  };
  link(1, 1, left_);
  link(static_cast<size_t>(depth.width()), static_cast<size_t>(depth.width()), up_);
  for (int y = 0; y < depth.height(); ++y) left_(0, y) = 0;
}

namespace {

// Along rows, to the right and back. Several rows at once, since each value waits for the one before it.
template <int kRows>
void sweep_rows(Image<float>& weighted, Image<float>& weights, const Image<float>& links, int first_row) {
  const int width = weighted.width();
  std::array<float*, kRows> a, b;
  std::array<const float*, kRows> link;
  for (int k = 0; k < kRows; ++k) {
    const auto row = static_cast<size_t>(k);
    a[row] = weighted.row(first_row + k), b[row] = weights.row(first_row + k), link[row] = links.row(first_row + k);
  }
  for (int x = 1; x < width; ++x)
    for (size_t k = 0; k < kRows; ++k) {
      a[k][x] += link[k][x] * (a[k][x - 1] - a[k][x]);
      b[k][x] += link[k][x] * (b[k][x - 1] - b[k][x]);
    }
  for (int x = width - 2; x >= 0; --x)
    for (size_t k = 0; k < kRows; ++k) {
      a[k][x] += link[k][x + 1] * (a[k][x + 1] - a[k][x]);
      b[k][x] += link[k][x + 1] * (b[k][x + 1] - b[k][x]);
    }
}

// Down and up again, in strips so narrow that they stay in the nearest cache.
constexpr int kStrip = 16;  // [cells]

DKB_KERNEL_BODY inline void take_row(float* to, const float* from, const float* link, int count) {
  DKB_INDEPENDENT_STEPS
  for (int x = 0; x < count; ++x) to[x] += link[x] * (from[x] - to[x]);
}

DKB_KERNEL_BODY inline void sweep_columns(Image<float>& weighted, Image<float>& weights, const Image<float>& links,
                                          int first, int count) {
  for (int y = 1; y < weighted.height(); ++y) {
    take_row(weighted.row(y) + first, weighted.row(y - 1) + first, links.row(y) + first, count);
    take_row(weights.row(y) + first, weights.row(y - 1) + first, links.row(y) + first, count);
  }
  for (int y = weighted.height() - 2; y >= 0; --y) {
    take_row(weighted.row(y) + first, weighted.row(y + 1) + first, links.row(y + 1) + first, count);
    take_row(weights.row(y) + first, weights.row(y + 1) + first, links.row(y + 1) + first, count);
  }
}

}  // namespace

void MotionSmoothing::smooth(Image<float>& weighted, Image<float>& weights) const {
  const int width = weighted.width(), height = weighted.height();
  for (int pass = 0; pass < 2; ++pass) {
    int y = 0;
    for (; y + 4 <= height; y += 4) sweep_rows<4>(weighted, weights, left_, y);
    for (; y < height; ++y) sweep_rows<1>(weighted, weights, left_, y);
    run_vectorised(simd_, [this, width, &weighted, &weights]() DKB_KERNEL_BODY {
      for (int x = 0; x < width; x += kStrip) sweep_columns(weighted, weights, up_, x, std::min(kStrip, width - x));
    });
  }
}

}  // namespace dkb
