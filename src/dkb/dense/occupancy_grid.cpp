// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/occupancy_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "dkb/map/map_suffix.h"

namespace dkb {
namespace {

constexpr int kRayStride = 4;       // view pixels between the rays that look for free cells
constexpr int kObstacleVoxels = 3;  // surface voxels of an obstacle's height that make a cell occupied
constexpr int kDropRays = 3;        // that look below a floor which nobody saw

struct Bounds {
  double x0 = 1e9, y0 = 1e9, x1 = -1e9, y1 = -1e9;
  void add(const Eigen::Vector3d& p) {
    x0 = std::min(x0, p.x());
    y0 = std::min(y0, p.y());
    x1 = std::max(x1, p.x());
    y1 = std::max(y1, p.y());
  }
};

// What the rays of views tell of cells: those that they pass below obstacle_high, up to one cell before what they hit,
// are free; and rays that end too low to be on the floor are counted where they are below it.
class RaysOfViews {
 public:
  RaysOfViews(OccupancyGrid* grid, const DenseOptions& options)
      : grid_(grid), options_(options), below_(grid->cells.width(), grid->cells.height()) {}

  void add(const PlacedView& placed, const ViewCamera& camera) {
    const Rigid3 floor_from_cam = grid_->floor_from_world * placed.cam_from_world.inverse();
    const Eigen::Matrix3d rotation = floor_from_cam.matrix3();
    for (int y = 0; y < camera.height; y += kRayStride)
      for (int x = 0; x < camera.width; x += kRayStride) {
        const double z = static_cast<double>(placed.view->metres(x, y));
        if (!(z > 0)) continue;
        const Eigen::Vector3d ray = rotation * camera.ray(x, y) * std::min(z, options_.max_depth);
        look_through(floor_from_cam.translation, ray);
        look_below(floor_from_cam.translation, ray);
      }
  }
  const Image<int>& below() const { return below_; }

 private:
  void look_through(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
    // The part of the ray that is above the floor and below obstacle_high.
    double from = 0, to = 1;
    const double low = -options_.obstacle_low, high = options_.obstacle_high;
    if (std::abs(ray.z()) < 1e-9) {
      if (eye.z() < low || eye.z() > high) return;
    } else {
      const double a = (low - eye.z()) / ray.z(), b = (high - eye.z()) / ray.z();
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    }
    const double flat = std::hypot(ray.x(), ray.y());
    if (ray.z() >= 0 || eye.z() + ray.z() > options_.obstacle_low) to -= flat > 0 ? grid_->cell / flat : 0;
    walk(eye, ray, from, to, grid_->cells, [](uint8_t& cell) { cell = OccupancyGrid::kFree; });
  }
  void look_below(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
    if (ray.z() >= 0 || eye.z() + ray.z() >= -options_.obstacle_low) return;
    const double from = std::max(0.0, -(eye.z() + 0.5 * options_.obstacle_low) / ray.z());
    walk(eye, ray, from, 1, below_, [](int& rays) { ++rays; });
  }
  // Each cell once that lies under this part of the ray.
  template <class Cell, class Use>
  void walk(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double from, double to, Image<Cell>& cells,
            const Use& use) const {
    if (from >= to) return;
    const double flat = std::hypot(ray.x(), ray.y());
    const int steps = static_cast<int>(std::ceil((to - from) * flat / (0.7 * grid_->cell))) + 1;
    int last_x = -1, last_y = -1;
    for (int i = 0; i <= steps; ++i) {
      const Eigen::Vector3d p = eye + (from + (to - from) * i / steps) * ray;
      const int x = static_cast<int>(std::floor((p.x() - grid_->origin_x) / grid_->cell));
      const int y = cells.height() - 1 - static_cast<int>(std::floor((p.y() - grid_->origin_y) / grid_->cell));
      if ((x == last_x && y == last_y) || !cells.contains(x, y)) continue;
      use(cells(x, y));
      last_x = x, last_y = y;
    }
  }

  OccupancyGrid* grid_;
  DenseOptions options_;
  Image<int> below_;
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

  RaysOfViews rays(&grid, options);
  for (const PlacedView& view : views) rays.add(view, camera);
  Image<int> obstacles(width, height), floor(width, height);
  for (const Eigen::Vector3f& v : mesh.vertices) {
    const Eigen::Vector3d p = floor_from_world * v.cast<double>();
    const int x = static_cast<int>(std::floor((p.x() - grid.origin_x) / grid.cell));
    const int y = height - 1 - static_cast<int>(std::floor((p.y() - grid.origin_y) / grid.cell));
    if (p.z() >= options.obstacle_low && p.z() <= options.obstacle_high) ++obstacles(x, y);
    if (std::abs(p.z()) < options.obstacle_low) ++floor(x, y);
  }
  for (size_t i = 0; i < grid.cells.size(); ++i)
    if (obstacles.data()[i] >= kObstacleVoxels)
      grid.cells.data()[i] = OccupancyGrid::kOccupied;
    else if (floor.data()[i] > 0)
      grid.cells.data()[i] = OccupancyGrid::kFree;
    else if (rays.below().data()[i] >= kDropRays)
      grid.cells.data()[i] = OccupancyGrid::kOccupied;
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
