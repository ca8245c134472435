// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/occupancy_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "dkb/dense/seen_space.h"
#include "dkb/map/map_suffix.h"

namespace dkb {
namespace {

struct Bounds {
  double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
  void add(const Eigen::Vector3d& p) {
    x0 = std::min(x0, p.x());
    y0 = std::min(y0, p.y());
    x1 = std::max(x1, p.x());
    y1 = std::max(y1, p.y());
  }
};

}  // namespace

OccupancyGrid make_occupancy_grid(const SurfaceMesh& mesh, std::span<const PlacedView> views, const ViewCamera& camera,
                                  const Rigid3& floor_from_world, const DenseOptions& options) {
  OccupancyGrid grid;
  grid.cell = options.grid_cell;
  grid.floor_from_world = floor_from_world;
  if (mesh.vertices.empty()) return grid;
  Bounds bounds;
  for (const Eigen::Vector3f& v : mesh.vertices) bounds.add(floor_from_world * v.cast<double>());
  for (const PlacedView& view : views) bounds.add(floor_from_world * centre_in_world(view.cam_from_world));
  // Whole cells, with one of margin.
  grid.origin_x = (std::floor(bounds.x0 / grid.cell) - 1) * grid.cell;
  grid.origin_y = (std::floor(bounds.y0 / grid.cell) - 1) * grid.cell;
  const int width = static_cast<int>(std::floor((bounds.x1 - grid.origin_x) / grid.cell)) + 2;
  const int height = static_cast<int>(std::floor((bounds.y1 - grid.origin_y) / grid.cell)) + 2;
  grid.cells = Image<uint8_t>(width, height, OccupancyGrid::kUnknown);
  SeenSpace seen(grid, options);
  for (const PlacedView& view : views) seen.add(view, camera);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) grid.cells(x, y) = seen.verdict(x, y);
  return grid;
}

std::string occupancy_pgm(const OccupancyGrid& grid) {
  std::string bytes = fmt::format("P5\n{} {}\n255\n", grid.cells.width(), grid.cells.height());
  bytes.append(reinterpret_cast<const char*>(grid.cells.data()), grid.cells.size());
  return bytes;
}

std::string occupancy_yaml(const OccupancyGrid& grid, const std::string& image) {
  const Eigen::Vector3d& t = grid.floor_from_world.translation;
  const Eigen::Quaterniond& q = grid.floor_from_world.rotation;
  return fmt::format(
      "image: {}\n"
      "mode: trinary\n"
      "resolution: {:g}\n"
      "origin: [{:.4f}, {:.4f}, 0.0]\n"
      "negate: 0\n"
      "occupied_thresh: 0.65\n"
      "free_thresh: 0.196\n"
      "# Map frame (z up, z = 0 on the floor) from the world of trajectory{}.txt: x y z qx qy qz qw\n"
      "floor_from_world: [{:.6f}, {:.6f}, {:.6f}, {:.7f}, {:.7f}, {:.7f}, {:.7f}]\n",
      image, grid.cell, grid.origin_x, grid.origin_y, map_suffix(static_cast<size_t>(grid.map)), t.x(), t.y(), t.z(),
      q.x(), q.y(), q.z(), q.w());
}

}  // namespace dkb
