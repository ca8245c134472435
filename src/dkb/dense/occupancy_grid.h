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

// Occupied: at least three vertices of the mesh between obstacle_low and obstacle_high above the floor; or a drop: no
// vertex within obstacle_low of the floor, and at least three rays below it that end deeper than obstacle_low.
// Free: seen through below obstacle_high by some view, or floor, and not occupied. Empty when nothing was seen.
OccupancyGrid make_occupancy_grid(const SurfaceMesh& mesh, std::span<const PlacedView> views, const ViewCamera& camera,
                                  const Rigid3& floor_from_world, const DenseOptions& options);

}  // namespace dkb
