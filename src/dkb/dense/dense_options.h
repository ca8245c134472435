// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

// The dense map of the still world, for navigation.
struct DenseOptions {
  double voxel = 0.02;          // [m] side of a voxel, 0.005 ... 0.2
  double truncation = 0.06;     // [m] distances to a surface are kept up to here, 2 ... 20 voxels
  double max_depth = 4.0;       // [m] depths beyond tell of free space only, 0.5 ... 16
  int pixel_step = 2;           // [px] every how many pixels, in x and y, depth is kept of a keyframe, 1 ... 8
  int mover_margin = 10;        // [px] around movers that is left out as well, 0 ... 100
  double grid_cell = 0.05;      // [m] side of a cell of the occupancy grid, 0.01 ... 1, >= 2 voxels
  double obstacle_low = 0.10;   // [m] above the floor: what is lower can be driven over, > 0
  double obstacle_high = 1.50;  // [m] what is higher can be driven under, > obstacle_low
  int threads = 2;              // of the fusion, >= 1: as robots go on tracking meanwhile; no result depends on it
};

}  // namespace dkb
