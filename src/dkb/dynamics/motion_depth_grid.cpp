// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_depth_grid.h"

#include <algorithm>
#include <array>
#include <limits>

#include "dkb/features/vectorised.h"

namespace dkb {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();
constexpr float kMinDepth = 0.1f;  // [m] in front of the camera

void resize(Image<float>& image, int width, int height) {
  if (image.width() != width || image.height() != height) image = Image<float>(width, height);
}

// Minimum (or maximum) over each value and its two neighbours in the column, then over three columns. `column` has room
// for a row and one more value at both ends.
template <class Pick>
DKB_KERNEL_BODY inline void spread(const Image<float>& source, float* column, Image<float>& target, Pick pick) {
  const int width = source.width(), height = source.height();
  for (int y = 0; y < height; ++y) {
    const float* a = source.row(std::max(0, y - 1));
    const float* b = source.row(y);
    const float* c = source.row(std::min(height - 1, y + 1));
    float* out = target.row(y);
    for (int x = 0; x < width; ++x) column[x + 1] = pick(pick(a[x], b[x]), c[x]);
    column[0] = column[1];
    column[width + 1] = column[width];
    for (int x = 0; x < width; ++x) out[x] = pick(pick(column[x], column[x + 1]), column[x + 2]);
  }
}

// Of four samples each in rows of `width` [m]; missing ones are 0: least and greatest, and the lower median; infinity,
// 0 and 0 where there is none.
DKB_KERNEL_BODY inline void depths_of_cells(const float* samples, int width, float* __restrict low,
                                            float* __restrict middle, float* __restrict high) {
  for (int x = 0; x < width; ++x) {
    // Sorted by a network of five exchanges; missing depth comes first.
    const float a = samples[x], b = samples[x + width], c = samples[x + 2 * width], d = samples[x + 3 * width];
    const float ab = std::min(a, b), ba = std::max(a, b), cd = std::min(c, d), dc = std::max(c, d);
    const float least = std::min(ab, cd), lower = std::max(ab, cd), upper = std::min(ba, dc), most = std::max(ba, dc);
    const float second = std::min(lower, upper), third = std::max(lower, upper);
    float first = most > 0 ? most : kFar, median = most;
    first = third > 0 ? third : first;
    median = third > 0 ? third : median;
    first = second > 0 ? second : first;
    first = least > 0 ? least : first;
    median = least > 0 ? second : median;
    low[x] = first;
    middle[x] = median;
    high[x] = most;
  }
}

}  // namespace

MotionRays::MotionRays(const CameraModel& camera, int cell)
    : cell_(cell), width_((camera.width + cell - 1) / cell), height_((camera.height + cell - 1) / cell) {
  const auto scale = static_cast<float>(cell);
  fx_ = static_cast<float>(camera.fx) / scale, fy_ = static_cast<float>(camera.fy) / scale;
  cx_ = (static_cast<float>(camera.cx) + 0.5f) / scale, cy_ = (static_cast<float>(camera.cy) + 0.5f) / scale;
  k1_ = static_cast<float>(camera.k1), k2_ = static_cast<float>(camera.k2), k3_ = static_cast<float>(camera.k3);
  k4_ = static_cast<float>(camera.k4), k5_ = static_cast<float>(camera.k5), k6_ = static_cast<float>(camera.k6);
  rational_ = camera.rational();
  p1_ = static_cast<float>(camera.p1), p2_ = static_cast<float>(camera.p2);
  x_.reserve(static_cast<size_t>(width_) * static_cast<size_t>(height_));
  y_.reserve(x_.capacity());
  r2_max_ = 0;
  for (int y = 0; y < height_; ++y)
    for (int x = 0; x < width_; ++x) {
      const Eigen::Vector2d pixel = camera.undistort({(x + 0.5) * cell - 0.5, (y + 0.5) * cell - 0.5});
      const Eigen::Vector3d ray = camera.unproject(pixel, 1.0);
      x_.push_back(static_cast<float>(ray.x()));
      y_.push_back(static_cast<float>(ray.y()));
      late_.push_back(late(y));
      r2_max_ = std::max(r2_max_, static_cast<float>(ray.head<2>().squaredNorm()));
    }
  r2_max_ *= 1.02f;  // far outside the image the distortion polynomial folds back
}

// The factor that moves a point outwards by its squared distance from the axis.
template <bool rational>
DKB_KERNEL_BODY static inline float radial_of(float r2, float k1, float k2, float k3, float k4, float k5, float k6) {
  const float polynomial = 1.0f + r2 * (k1 + r2 * (k2 + r2 * k3));
  if constexpr (rational) return polynomial / (1.0f + r2 * (k4 + r2 * (k5 + r2 * k6)));
  return polynomial;
}

// At depth 1; r2 = a^2 + b^2.
DKB_KERNEL_BODY static inline void distort(float a, float b, float r2, float radial, float p1, float p2, float* u,
                                           float* v) {
  *u = a * radial + 2.0f * p1 * a * b + p2 * (r2 + 2.0f * a * a);
  *v = b * radial + p1 * (r2 + 2.0f * b * b) + 2.0f * p2 * a * b;
}

// The lens is left out: it moves a row by less than what a row's delay does.
DKB_KERNEL_BODY static inline float late_at(float y, float z, float per_slope, float middle) {
  return std::min(std::max(y / std::max(z, kMinDepth) * per_slope + middle, -0.5f), 0.5f);
}

float MotionRays::late_of(const Eigen::Vector3f& point) const {
  const auto rows = static_cast<float>(height_);
  return late_at(point.y(), point.z(), fy_ / rows, cy_ / rows - 0.5f);
}

bool MotionRays::find_cell(const Eigen::Vector3f& middle, int* x, int* y, const ReadoutMotion& readout) const {
  const Eigen::Vector3f point = middle + late_of(middle) * readout.of(middle);
  if (!(point.z() > kMinDepth)) return false;
  const float a = point.x() / point.z(), b = point.y() / point.z(), r2 = a * a + b * b;
  if (!(r2 <= r2_max_)) return false;
  float u = 0, v = 0;
  const float radial = rational_ ? radial_of<true>(r2, k1_, k2_, k3_, k4_, k5_, k6_)
                                 : radial_of<false>(r2, k1_, k2_, k3_, k4_, k5_, k6_);
  distort(a, b, r2, radial, p1_, p2_, &u, &v);
  u = fx_ * u + cx_, v = fy_ * v + cy_;
  if (!(u >= 0 && v >= 0 && u < static_cast<float>(width_) && v < static_cast<float>(height_))) return false;
  *x = static_cast<int>(u), *y = static_cast<int>(v);
  return true;
}

void MotionRays::project(const Image<float>& depth, float missing, const Rigid3& there_from_here, CellRange range,
                         MotionProjection& result, Simd simd, const ReadoutMotion& here,
                         const ReadoutMotion& there) const {
  rational_ ? project_by<true>(depth, missing, there_from_here, range, result, simd, here, there)
            : project_by<false>(depth, missing, there_from_here, range, result, simd, here, there);
}

template <bool rational>
void MotionRays::project_by(const Image<float>& depth, float missing, const Rigid3& there_from_here, CellRange range,
                            MotionProjection& result, Simd simd, const ReadoutMotion& here,
                            const ReadoutMotion& there) const {
  const Eigen::Matrix3f r = there_from_here.matrix3().cast<float>();
  const Eigen::Vector3f t = there_from_here.translation.cast<float>();
  const float r00 = r(0, 0), r01 = r(0, 1), r02 = r(0, 2), r10 = r(1, 0), r11 = r(1, 1), r12 = r(1, 2);
  const float r20 = r(2, 0), r21 = r(2, 1), r22 = r(2, 2), tx = t.x(), ty = t.y(), tz = t.z();
  const float fx = fx_, fy = fy_, cx = cx_ + 1.0f, cy = cy_ + 1.0f, k1 = k1_, k2 = k2_, k3 = k3_, p1 = p1_, p2 = p2_;
  const float k4 = k4_, k5 = k5_, k6 = k6_;
  const float r2_max = r2_max_, right = static_cast<float>(width_) + 1.0f, bottom = static_cast<float>(height_) + 1.0f;
  const int32_t width = width_, height = height_;
  const size_t count = range.count;
  result.cell.resize(count);
  result.depth.resize(count);
  const float* const xs = x_.data() + range.first;
  const float* const ys = y_.data() + range.first;
  const float* const zs = depth.data() + range.first;
  const float* const lates = late_.data() + range.first;
  const float hx = here.turn.x(), hy = here.turn.y(), hz = here.turn.z();
  const float hu = here.shift.x(), hv = here.shift.y(), hw = here.shift.z();
  const float gx = there.turn.x(), gy = there.turn.y(), gz = there.turn.z();
  const float gu = there.shift.x(), gv = there.shift.y(), gw = there.shift.z();
  const float per_slope = fy_ / static_cast<float>(height_), middle = cy_ / static_cast<float>(height_) - 0.5f;
  int32_t* const cells = result.cell.data();
  float* const depths = result.depth.data();
  // Coordinates are counted from 1 and cut to one cell around the grid: 0 and size + 1 are outside.
  run_vectorised(simd, [=]() DKB_KERNEL_BODY {
    for (size_t i = 0; i < count; ++i) {
      const float z = zs[i] > 0.0f ? zs[i] : missing;
      const float x = z * xs[i], y = z * ys[i], early = -lates[i];
      const float qx = x + early * (hy * z - hz * y + hu), qy = y + early * (hz * x - hx * z + hv);
      const float qz = z + early * (hx * y - hy * x + hw);
      const float mx = r00 * qx + r01 * qy + r02 * qz + tx;
      const float my = r10 * qx + r11 * qy + r12 * qz + ty;
      const float mz = r20 * qx + r21 * qy + r22 * qz + tz;
      const float late = late_at(my, mz, per_slope, middle);
      const float px = mx + late * (gy * mz - gz * my + gu), py = my + late * (gz * mx - gx * mz + gv);
      const float pz = mz + late * (gx * my - gy * mx + gw);
      const float inverse = 1.0f / std::max(pz, kMinDepth), a = px * inverse, b = py * inverse, r2 = a * a + b * b;
      float u, v;
      distort(a, b, r2, radial_of<rational>(r2, k1, k2, k3, k4, k5, k6), p1, p2, &u, &v);
      const int32_t ix = static_cast<int32_t>(std::min(std::max(fx * u + cx, 0.0f), right)) - 1;
      const int32_t iy = static_cast<int32_t>(std::min(std::max(fy * v + cy, 0.0f), bottom)) - 1;
      const bool seen = (pz > kMinDepth) & (r2 <= r2_max) & (ix >= 0) & (iy >= 0) & (ix < width) & (iy < height);
      cells[i] = seen ? iy * width + ix : -1;
      depths[i] = pz;
    }
  });
}

void MotionDepthGrid::set_depth(const DepthImage& image, const MotionRays& rays, Simd simd) {
  const int width = rays.width(), height = rays.height(), cell = rays.cell();
  for (Image<float>* i : {&depth, &nearest, &farthest, &score, &low_, &high_}) resize(*i, width, height);
  const auto columns = static_cast<size_t>(width);
  buffer_.resize(4 * columns + 2);
  // Four pixels of each cell, in a rotated square so that every row and column of it counts once.
  const std::array<int, 4> dx{cell / 4, cell * 3 / 4, 0, cell / 2}, dy{0, cell / 4, cell / 2, cell * 3 / 4};
  const int inner = image.width() / cell;
  for (int y = 0; y < height; ++y) {
    for (size_t k = 0; k < 4; ++k) {
      const float* const row = image.row(std::min(image.height() - 1, y * cell + dy[k]));
      float* const out = buffer_.data() + k * columns;
      for (int x = 0; x < inner; ++x) out[x] = row[x * cell + dx[k]];
      for (int x = inner; x < width; ++x) out[x] = row[std::min(image.width() - 1, x * cell + dx[k])];
    }
    run_vectorised(simd, [width, in = buffer_.data(), low = low_.row(y), out = depth.row(y), high = high_.row(y)]()
                             DKB_KERNEL_BODY { depths_of_cells(in, width, low, out, high); });
  }
  run_vectorised(simd, [this]() DKB_KERNEL_BODY {
    spread(low_, buffer_.data(), nearest, [](float a, float b) { return std::min(a, b); });
    spread(high_, buffer_.data(), farthest, [](float a, float b) { return std::max(a, b); });
  });
}

void MotionView::set(const MotionDepthGrid& grid) {
  time = grid.time;
  cam_from_world = grid.cam_from_world;
  velocity = grid.velocity;
  cells.resize(grid.depth.size());
  for (size_t i = 0; i < cells.size(); ++i)
    cells[i] = {grid.nearest.data()[i], grid.farthest.data()[i], grid.depth.data()[i], grid.score.data()[i]};
}

}  // namespace dkb
