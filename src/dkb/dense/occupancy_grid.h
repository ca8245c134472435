// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "dkb/dense/dense_options.h"
#include "dkb/dense/surface_mesh.h"
#include "dkb/dense/tsdf_volume.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/image/image.h"

namespace dkb {

// Where a robot can drive: cells of the floor, seen from above.
struct OccupancyGrid {
  static constexpr uint8_t kOccupied = 0, kUnknown = 205, kFree = 254;  // as ROS' map_saver writes them

  double cell = 0.05;                 // [m]
  double origin_x = 0, origin_y = 0;  // [m] of the lower left corner of the lower left cell, on the floor
  Image<uint8_t> cells;               // row 0 is the top: the largest y
  Rigid3 floor_from_world;            // z = 0 is the floor, z up
};

// Occupied: at least `obstacle_voxels` vertices of the mesh between obstacle_low and obstacle_high above the floor.
// Free: seen through below obstacle_high by some view, or floor, and not occupied. Empty when nothing was seen.
OccupancyGrid make_occupancy_grid(const SurfaceMesh& mesh, std::span<const PlacedView> views, const ViewCamera& camera,
                                  const Rigid3& floor_from_world, const DenseOptions& options);

// The two files that ROS' map_server reads (binary PGM and YAML). `image` is the name of the first within the second.
// The YAML also says floor_from_world (x y z qx qy qz qw), which map_server passes over.
std::string occupancy_pgm(const OccupancyGrid& grid);
std::string occupancy_yaml(const OccupancyGrid& grid, const std::string& image);

}  // namespace dkb
