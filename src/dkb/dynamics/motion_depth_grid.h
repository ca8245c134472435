// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/features/simd.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/image.h"

namespace dkb {

// Cells of a grid, counted by rows.
struct CellRange {
  size_t first = 0, count = 0;
};

// Where cells of one grid appear in another, from the first of a range on.
struct MotionProjection {
  std::vector<int32_t> cell;  // index of the cell that sees the surface; -1 when none does
  std::vector<float> depth;   // [m] of the surface in that camera; of no meaning where cell is -1
};

// Viewing rays of a coarse grid of square cells over the image as the camera gives it (distorted), and the way back.
class MotionRays {
 public:
  MotionRays(const CameraModel& camera, int cell);

  int cell() const { return cell_; }      // [px]
  int width() const { return width_; }    // [cells]
  int height() const { return height_; }  // [cells]

  // Through the middle of a cell, at depth 1.
  Eigen::Vector3f ray(int x, int y) const {
    return ray(static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x));
  }
  Eigen::Vector3f ray(size_t cell) const { return {x_[cell], y_[cell], 1}; }
  // The cell that sees a point of the camera's; false when none does.
  bool find_cell(const Eigen::Vector3f& point, int* x, int* y) const;
  // Projects what each cell in `range` sees at `depth` [m], `missing` standing in for depth that is not above 0, into
  // the camera that `there_from_here` leads to.
  void project(const Image<float>& depth, float missing, const Rigid3& there_from_here, CellRange range,
               MotionProjection& result, Simd simd = best_simd()) const;
  CellRange all_cells() const { return {0, x_.size()}; }

 private:
  // The rational model costs a division more for each cell.
  template <bool rational>
  void project_by(const Image<float>& depth, float missing, const Rigid3& there_from_here, CellRange range,
                  MotionProjection& result, Simd simd) const;

  int cell_, width_, height_;
  float fx_, fy_, cx_, cy_;  // in cells
  float k1_, k2_, k3_, k4_, k5_, k6_, p1_, p2_, r2_max_;
  bool rational_;
  std::vector<float> x_, y_;  // rays through the cells' middles, at depth 1
};

// Score from which a surface is no witness of what stands still: less than a frame says of a mover (1).
inline constexpr float kMayMove = 0.3f;

// A depth image on that grid, and where its camera stood.
struct MotionDepthGrid {
  double time = 0;                 // [s] of the depth image
  Rigid3 cam_from_world;           // at that time
  Image<float> depth;              // [m] of the cell's middle, 0 = none
  Image<float> nearest, farthest;  // [m] over the cell and its eight neighbours; infinity and 0 where there is no depth
  Image<float> score;              // evidence for motion of what is seen in each cell

  // Sets the three depth maps. Buffers are kept.
  void set_depth(const DepthImage& image, const MotionRays& rays, Simd simd = best_simd());

 private:
  Image<float> low_, high_;
  std::vector<float> buffer_;  // some rows
};

// A grid that later ones are compared with, cell by cell: what is known of a cell lies together.
struct MotionView {
  struct Cell {
    float nearest, farthest, depth, score;  // as in MotionDepthGrid
  };

  double time = 0;
  Rigid3 cam_from_world;
  std::vector<Cell> cells;

  void set(const MotionDepthGrid& grid);
};

}  // namespace dkb
