// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/simulator/furniture.h"

namespace dkb::sim {

// A hole between two cells on the ground plan, as high as the room.
struct Portal {
  Eigen::Vector2d a, b;
  int to = 0;
};

// A room, corridor or doorway whose walls hide all other cells, but for what its portals show.
struct Cell {
  Footprint area;
  Furnishing furnishing;
  std::vector<Portal> portals;
};

// The cell that holds a place; the nearest if none does.
size_t cell_at(const std::vector<Cell>& cells, const Eigen::Vector2d& place);

// Which cells a camera may see (upright but for some pitch and roll), and from any pose within `slack` [m, and rad] of
// the given one: the view is followed from portal to portal and cut to each on the way.
std::vector<bool> visible_cells(const std::vector<Cell>& cells, const CameraModel& camera, const Rigid3& scene_from_cam,
                                double slack);

}  // namespace dkb::sim
