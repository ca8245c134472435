// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/image.h"

namespace dkb {

// Viewing rays of a coarse grid of square cells over the image as the camera gives it (distorted), and the way back.
class MotionRays {
 public:
  MotionRays(const CameraModel& camera, int cell);

  int cell() const { return cell_; }      // [px]
  int width() const { return width_; }    // [cells]
  int height() const { return height_; }  // [cells]
  // Ray through the middle of a cell, at depth 1, in camera axes: (x, y, 1).
  const Eigen::Vector2f& ray(size_t index) const { return rays_[index]; }

  // Index of the cell that sees a point of the camera frame with z > 0; -1 when none does.
  int cell_of(float x, float y, float z) const {
    const float inverse = 1.0f / z, a = x * inverse, b = y * inverse;
    const float r2 = a * a + b * b;
    if (r2 > r2_max_) return -1;
    const float radial = 1.0f + r2 * (k1_ + r2 * (k2_ + r2 * k3_));
    const float u = a * radial + 2.0f * p1_ * a * b + p2_ * (r2 + 2.0f * a * a);
    const float v = b * radial + p1_ * (r2 + 2.0f * b * b) + 2.0f * p2_ * a * b;
    const float gx = fx_ * u + cx_, gy = fy_ * v + cy_;  // [cells] from the grid's edge
    if (!(gx >= 0.0f && gy >= 0.0f)) return -1;
    const int ix = static_cast<int>(gx), iy = static_cast<int>(gy);
    if (ix >= width_ || iy >= height_) return -1;
    return iy * width_ + ix;
  }

 private:
  int cell_, width_, height_;
  float fx_, fy_, cx_, cy_;  // in cells
  float k1_, k2_, k3_, p1_, p2_, r2_max_;
  std::vector<Eigen::Vector2f> rays_;
};

// A depth image on that grid, and where its camera stood.
struct MotionDepthGrid {
  double time = 0;                 // [s] of the depth image
  Rigid3 cam_from_world;           // at that time
  Image<float> depth;              // [m] of the cell's middle, 0 = none
  Image<float> nearest, farthest;  // [m] over the cell and its eight neighbours; infinity and 0 where there is no depth
  Image<float> score;              // evidence for motion of what is seen in each cell

  // Sets the three depth maps. Buffers are kept.
  void set_depth(const DepthImage& image, const MotionRays& rays);

 private:
  Image<float> low_, high_;
};

}  // namespace dkb
