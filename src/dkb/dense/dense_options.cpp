// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/dense_options.h"

#include "dkb/util/errors.h"

namespace dkb {

void DenseOptions::check() const {
  require_option(voxel >= 0.005 && voxel <= 0.2, "dense.voxel", voxel, "0.005 ... 0.2 m");
  require_option(truncation >= 2 * voxel && truncation <= 20 * voxel, "dense.truncation", truncation,
                 "2 ... 20 times dense.voxel");
  require_option(max_depth >= 0.5 && max_depth <= 20, "dense.max_depth", max_depth, "0.5 ... 20 m");
  require_option(pixel_step >= 1 && pixel_step <= 8, "dense.pixel_step", pixel_step, "1 ... 8 px");
  require_option(mover_margin >= 0 && mover_margin <= 100, "dense.mover_margin", mover_margin, "0 ... 100 px");
  require_option(edge_fraction > 0, "dense.edge_fraction", edge_fraction, "greater than 0");
  require_option(min_views >= 1, "dense.min_views", min_views, "at least 1");
  require_option(free_share >= 0 && free_share <= 1, "dense.free_share", free_share, "0 ... 1");
  require_option(min_patch >= 0, "dense.min_patch", min_patch, "at least 0 m^2");
  require_option(grid_cell >= 0.01 && grid_cell <= 1, "dense.grid_cell", grid_cell, "0.01 ... 1 m");
  require_option(obstacle_low > 0, "dense.obstacle_low", obstacle_low, "greater than 0 m");
  require_option(obstacle_high > obstacle_low, "dense.obstacle_high", obstacle_high, "greater than dense.obstacle_low");
  require_option(obstacle_voxels >= 1, "dense.obstacle_voxels", obstacle_voxels, "at least 1");
  require_option(threads >= 1 && threads <= 64, "dense.threads", threads, "1 ... 64");
}

}  // namespace dkb
