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

// Occupied: something was measured between obstacle_low and obstacle_high above the floor, by two views more than saw
// through its place and over 0.2 s at least (unknown when for less); or a drop: more rays, and at least three, are
// below the floor than end on it. Free: seen through between these heights by some view, or floor, and not occupied.
// Empty when there is no mesh. `views` by increasing time.
OccupancyGrid make_occupancy_grid(const SurfaceMesh& mesh, std::span<const PlacedView> views, const ViewCamera& camera,
                                  const Rigid3& floor_from_world, const DenseOptions& options);

}  // namespace dkb
