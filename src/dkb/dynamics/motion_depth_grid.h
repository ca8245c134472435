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

// How what is before a camera moves while the rows of its image are read: at p [m] in the middle of that time, it is at
// p + s (turn x p + shift) when a row is, with s from -0.5, the first row, to 0.5, the last.
struct ReadoutMotion {
  ReadoutMotion() = default;
  // `velocity`: of points before the camera [m/s, rad/s]; `readout` [s]: from the first row to the last.
  ReadoutMotion(const Vector6d& velocity, double readout)
      : turn((readout * velocity.tail<3>()).cast<float>()), shift((readout * velocity.head<3>()).cast<float>()) {}

  Eigen::Vector3f of(const Eigen::Vector3f& point) const { return turn.cross(point) + shift; }

  Eigen::Vector3f turn = Eigen::Vector3f::Zero();   // [rad]
  Eigen::Vector3f shift = Eigen::Vector3f::Zero();  // [m]
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
  // When a row of cells is read, as a share of the readout after its middle: -0.5 ... 0.5.
  float late(int y) const { return (static_cast<float>(y) + 0.5f) / static_cast<float>(height_) - 0.5f; }
  // What a cell sees at `depth` [m], where it is in the middle of the readout.
  Eigen::Vector3f point(int x, int y, float depth, const ReadoutMotion& readout) const {
    const Eigen::Vector3f seen = depth * ray(x, y);
    return seen - late(y) * readout.of(seen);
  }
  // The cell that sees a point which is there in the middle of the readout; false when none does.
  bool find_cell(const Eigen::Vector3f& point, int* x, int* y, const ReadoutMotion& readout = {}) const;
  // Projects what each cell in `range` sees at `depth` [m], `missing` standing in for depth that is not above 0, into
  // the camera that `there_from_here` leads to, from the middle of the one's readout to that of the other's.
  void project(const Image<float>& depth, float missing, const Rigid3& there_from_here, CellRange range,
               MotionProjection& result, Simd simd = best_simd(), const ReadoutMotion& here = {},
               const ReadoutMotion& there = {}) const;
  CellRange all_cells() const { return {0, x_.size()}; }

 private:
  // The rational model costs a division more for each cell.
  template <bool rational>
  void project_by(const Image<float>& depth, float missing, const Rigid3& there_from_here, CellRange range,
                  MotionProjection& result, Simd simd, const ReadoutMotion& here, const ReadoutMotion& there) const;
  // As late(), of the row that sees a point before the camera, were it still.
  float late_of(const Eigen::Vector3f& point) const;

  int cell_, width_, height_;
  float fx_, fy_, cx_, cy_;  // in cells
  float k1_, k2_, k3_, k4_, k5_, k6_, p1_, p2_, r2_max_;
  bool rational_;
  std::vector<float> x_, y_;  // rays through the cells' middles, at depth 1
  std::vector<float> late_;   // of each cell's row
};

// Score from which a surface is no witness of what stands still: less than a frame says of a mover (1).
inline constexpr float kMayMove = 0.3f;

// A depth image on that grid, and where its camera stood.
struct MotionDepthGrid {
  double time = 0;                       // [s] of the depth image
  Rigid3 cam_from_world;                 // at that time
  Vector6d velocity = Vector6d::Zero();  // [m/s, rad/s] of what is before it, were all still
  Image<float> depth;                    // [m] of the cell's middle, 0 = none
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
  Vector6d velocity = Vector6d::Zero();
  std::vector<Cell> cells;

  void set(const MotionDepthGrid& grid);
};

}  // namespace dkb
