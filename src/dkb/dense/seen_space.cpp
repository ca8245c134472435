// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/seen_space.h"

#include <algorithm>
#include <cmath>

#include "dkb/util/radix_sort.h"

namespace dkb {
namespace {

constexpr int kRayStride = 4;  // view pixels between the rays that look for free space
constexpr int kDropRays = 3;   // that look below a floor which nobody saw
constexpr double kMostLayers = 32;

// Of OctoMap (Hornung et al. 2013, "OctoMap: an efficient probabilistic 3D mapping framework based on octrees", section
// 5.1), in twentieths: what a view that sees a surface in a voxel adds to its log odds, what one that sees through it
// takes, and their bounds.
constexpr int kHit = 17, kMiss = -8, kLeast = -40, kMost = 70;

// As high as a cell is wide, but no more than fit into memory and a voxel's number.
int layers_of(const OccupancyGrid& grid, const DenseOptions& options) {
  const double as_cells = std::ceil((options.obstacle_high - options.obstacle_low) / grid.cell - 1e-9);
  const double numbers = std::floor(4e9 / static_cast<double>(std::max<size_t>(1, grid.cells.size())));
  return static_cast<int>(std::clamp(as_cells, 1.0, std::clamp(numbers, 1.0, kMostLayers)));
}

void sort_once(std::vector<uint32_t>* voxels) {
  radix_sort(*voxels);
  voxels->erase(std::unique(voxels->begin(), voxels->end()), voxels->end());
}

}  // namespace

SeenSpace::SeenSpace(const OccupancyGrid& grid, const DenseOptions& options)
    : grid_(grid),
      options_(options),
      layers_(layers_of(grid, options)),
      log_odds_(grid.cells.size() * static_cast<size_t>(layers_), 0),
      stands_(grid.cells.width(), grid.cells.height()),
      floor_(grid.cells.width(), grid.cells.height()),
      below_(grid.cells.width(), grid.cells.height()) {}

void SeenSpace::add(const PlacedView& placed, const ViewCamera& camera) {
  const Rigid3 floor_from_cam = grid_.floor_from_world * placed.cam_from_world.inverse();
  const Eigen::Matrix3d rotation = floor_from_cam.matrix3();
  const Eigen::Vector3d& eye = floor_from_cam.translation;
  if (!begin_) begin_ = placed.view->depth_time;
  const auto time = static_cast<float>(placed.view->depth_time - *begin_);
  hit_.clear(), passed_.clear();
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const double z = static_cast<double>(placed.view->metres(x, y));
      if (!(z > 0)) continue;
      const Eigen::Vector3d ray = rotation * camera.ray(x, y) * std::min(z, options_.max_depth);
      const bool ends = z <= options_.max_depth;
      if (ends) hit(eye + ray, time);
      if (x % kRayStride != 0 || y % kRayStride != 0) continue;
      look_through(eye, ray, ends);
      look_below(eye, ray);
      if (ends) see_floor(eye + ray);
    }
  // A view speaks once of each voxel; where some of its rays end, others pass above or beside what is there.
  sort_once(&hit_), sort_once(&passed_);
  auto at = hit_.begin();
  for (const uint32_t voxel : passed_) {
    while (at != hit_.end() && *at < voxel) ++at;
    if (at == hit_.end() || *at != voxel) change(voxel, kMiss);
  }
  for (const uint32_t voxel : hit_) change(voxel, kHit);
}

uint8_t SeenSpace::verdict(int x, int y) const {
  const auto column = log_odds_.begin() + static_cast<std::ptrdiff_t>(first_voxel(x, y));
  const auto [least, most] = std::minmax_element(column, column + layers_);
  const Stands& stands = stands_(x, y);
  // One view alone does not make an obstacle, nor is what it saw free.
  if (*most > kHit && stands.last - stands.first >= kStandsFor) return OccupancyGrid::kOccupied;
  if (*most > 0) return OccupancyGrid::kUnknown;
  if (below_(x, y) >= kDropRays && below_(x, y) > floor_(x, y)) return OccupancyGrid::kOccupied;
  return *least < 0 || floor_(x, y) > 0 ? OccupancyGrid::kFree : OccupancyGrid::kUnknown;
}

bool SeenSpace::find_cell(const Eigen::Vector3d& p, int* x, int* y) const {
  *x = static_cast<int>(std::floor((p.x() - grid_.origin_x) / grid_.cell));
  *y = grid_.cells.height() - 1 - static_cast<int>(std::floor((p.y() - grid_.origin_y) / grid_.cell));
  return grid_.cells.contains(*x, *y);
}

size_t SeenSpace::first_voxel(int x, int y) const {
  return (static_cast<size_t>(y) * static_cast<size_t>(grid_.cells.width()) + static_cast<size_t>(x)) *
         static_cast<size_t>(layers_);
}

// The voxel of a point in a cell; nothing below obstacle_low and above obstacle_high.
std::optional<uint32_t> SeenSpace::voxel_at(const Eigen::Vector3d& p, int x, int y) const {
  const double layer =
      std::floor(layers_ * (p.z() - options_.obstacle_low) / (options_.obstacle_high - options_.obstacle_low));
  if (!(layer >= 0 && layer < layers_)) return std::nullopt;
  return static_cast<uint32_t>(first_voxel(x, y) + static_cast<size_t>(layer));
}

void SeenSpace::change(uint32_t voxel, int by) {
  log_odds_[voxel] = static_cast<int8_t>(std::clamp(log_odds_[voxel] + by, kLeast, kMost));
}

void SeenSpace::hit(const Eigen::Vector3d& end, float time) {
  int x = 0, y = 0;
  if (!find_cell(end, &x, &y)) return;
  const auto voxel = voxel_at(end, x, y);
  if (!voxel) return;
  hit_.push_back(*voxel);
  Stands& stands = stands_(x, y);
  stands = {std::min(stands.first, time), std::max(stands.last, time)};
}

void SeenSpace::see_floor(const Eigen::Vector3d& end) {
  int x = 0, y = 0;
  if (std::abs(end.z()) < options_.obstacle_low && find_cell(end, &x, &y)) ++floor_(x, y);
}

// Up to a cell before what the ray ends at.
void SeenSpace::look_through(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, bool ends) {
  const double before_end = ends ? std::max(0.0, 1 - grid_.cell / ray.norm()) : 1;
  walk(eye, ray, 0, before_end, [this](const Eigen::Vector3d& p, int x, int y) {
    if (const auto voxel = voxel_at(p, x, y)) passed_.push_back(*voxel);
  });
}

// The part of a ray that is below a floor where none is.
void SeenSpace::look_below(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
  if (ray.z() >= 0 || eye.z() + ray.z() >= -options_.obstacle_low) return;
  const double from = std::max(0.0, -(eye.z() + 0.5 * options_.obstacle_low) / ray.z());
  int last_x = -1, last_y = -1;
  walk(eye, ray, from, 1, [&](const Eigen::Vector3d&, int x, int y) {
    if (x != last_x || y != last_y) ++below_(x, y);
    last_x = x, last_y = y;
  });
}

template <class Use>
void SeenSpace::walk(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double from, double to,
                     const Use& use) const {
  if (from >= to) return;
  const int steps = static_cast<int>(std::ceil((to - from) * ray.norm() / (0.7 * grid_.cell))) + 1;
  for (int i = 0; i <= steps; ++i) {
    const Eigen::Vector3d p = eye + (from + (to - from) * i / steps) * ray;
    int x = 0, y = 0;
    if (find_cell(p, &x, &y)) use(p, x, y);
  }
}

}  // namespace dkb
