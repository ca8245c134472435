// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_depth_grid.h"

#include <algorithm>
#include <array>
#include <limits>

namespace dkb {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

void resize(Image<float>& image, int width, int height) {
  if (image.width() != width || image.height() != height) image = Image<float>(width, height);
}

// Minimum (or maximum) over each value and its two neighbours in the row, then over the three rows.
template <class Pick>
void spread(const Image<float>& source, Image<float>& target, Pick pick) {
  const int width = source.width(), height = source.height();
  for (int y = 0; y < height; ++y) {
    const float* a = source.row(std::max(0, y - 1));
    const float* b = source.row(y);
    const float* c = source.row(std::min(height - 1, y + 1));
    float* out = target.row(y);
    for (int x = 0; x < width; ++x) out[x] = pick(pick(a[x], b[x]), c[x]);
    float left = out[0];
    for (int x = 0; x + 1 < width; ++x) {
      const float here = out[x];
      out[x] = pick(pick(left, here), out[x + 1]);
      left = here;
    }
    out[width - 1] = pick(left, out[width - 1]);
  }
}

}  // namespace

MotionRays::MotionRays(const CameraModel& camera, int cell)
    : cell_(cell), width_((camera.width + cell - 1) / cell), height_((camera.height + cell - 1) / cell) {
  const auto scale = static_cast<float>(cell);
  fx_ = static_cast<float>(camera.fx) / scale, fy_ = static_cast<float>(camera.fy) / scale;
  cx_ = (static_cast<float>(camera.cx) + 0.5f) / scale, cy_ = (static_cast<float>(camera.cy) + 0.5f) / scale;
  k1_ = static_cast<float>(camera.k1), k2_ = static_cast<float>(camera.k2), k3_ = static_cast<float>(camera.k3);
  p1_ = static_cast<float>(camera.p1), p2_ = static_cast<float>(camera.p2);
  rays_.reserve(static_cast<size_t>(width_) * static_cast<size_t>(height_));
  r2_max_ = 0;
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const Eigen::Vector2d pixel = camera.undistort({(x + 0.5) * cell - 0.5, (y + 0.5) * cell - 0.5});
      rays_.push_back(camera.unproject(pixel, 1.0).head<2>().cast<float>());
      r2_max_ = std::max(r2_max_, rays_.back().squaredNorm());
    }
  r2_max_ *= 1.02f;  // far outside the image the distortion polynomial folds back
}

void MotionDepthGrid::set_depth(const DepthImage& image, const MotionRays& rays) {
  const int width = rays.width(), height = rays.height(), cell = rays.cell();
  for (Image<float>* i : {&depth, &nearest, &farthest, &score, &low_, &high_}) resize(*i, width, height);
  // Four pixels of each cell, in a rotated square so that every row and column of it counts once.
  const std::array<int, 4> dx{cell / 4, cell * 3 / 4, 0, cell / 2}, dy{0, cell / 4, cell / 2, cell * 3 / 4};
  for (int y = 0; y < height; ++y) {
    std::array<const float*, 4> rows;
    for (size_t k = 0; k < 4; ++k) rows[k] = image.row(std::min(image.height() - 1, y * cell + dy[k]));
    const int inner = image.width() / cell;
    float* out = depth.row(y);
    float* low = low_.row(y);
    float* high = high_.row(y);
    for (int x = 0; x < width; ++x) {
      std::array<float, 4> z;
      for (size_t k = 0; k < 4; ++k) {
        const int at = x < inner ? x * cell + dx[k] : std::min(image.width() - 1, x * cell + dx[k]);
        z[k] = rows[k][at];
      }
      // Sorted by a network of five exchanges; missing depth (0) comes first.
      const auto order = [&](size_t a, size_t b) {
        const float lower = std::min(z[a], z[b]);
        z[b] = std::max(z[a], z[b]);
        z[a] = lower;
      };
      order(0, 1), order(2, 3), order(0, 2), order(1, 3), order(1, 2);
      high[x] = z[3];
      const size_t first = z[0] > 0 ? 0 : z[1] > 0 ? 1 : z[2] > 0 ? 2 : 3;
      low[x] = z[3] > 0 ? z[first] : kFar;
      out[x] = z[first + (3 - first) / 2];
    }
  }
  spread(low_, nearest, [](float a, float b) { return std::min(a, b); });
  spread(high_, farthest, [](float a, float b) { return std::max(a, b); });
}

}  // namespace dkb
