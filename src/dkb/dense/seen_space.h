// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "dkb/dense/dense_options.h"
#include "dkb/dense/surface_mesh.h"
#include "dkb/dense/tsdf_volume.h"
#include "dkb/image/image.h"

namespace dkb {

// What depth images tell of the space above the cells of a grid, voxel by voxel between obstacle_low and obstacle_high,
// and of the floor below. A surface that was measured stands in the way of a robot until other views see through its
// place, whether or not it was seen well enough to become part of the mesh: a table top seen at a flat angle, a thin
// leg. Views are given by increasing time. Deterministic.
class SeenSpace {
 public:
  // Of the grid's cells as they lie; `grid` outlives the object.
  SeenSpace(const OccupancyGrid& grid, const DenseOptions& options);

  void add(const PlacedView& placed, const ViewCamera& camera);

  // Of a cell: occupied, free or unknown (make_occupancy_grid).
  uint8_t verdict(int x, int y) const;

 private:
  struct Stands {  // [s] when the first and the last view saw something stand in a cell, since the first view of all
    float first = std::numeric_limits<float>::infinity(), last = -std::numeric_limits<float>::infinity();
  };

  bool find_cell(const Eigen::Vector3d& point, int* x, int* y) const;
  size_t first_voxel(int x, int y) const;
  std::optional<uint32_t> voxel_at(const Eigen::Vector3d& point, int x, int y) const;
  void hit(const Eigen::Vector3d& end, float time);
  void look_through(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, bool ends);
  void look_below(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray);
  void see_floor(const Eigen::Vector3d& end);
  template <class Use>
  void walk(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray, double from, double to, const Use& use) const;
  void change(uint32_t voxel, int by);

  const OccupancyGrid& grid_;
  DenseOptions options_;
  int layers_;                    // of voxels
  std::vector<int8_t> log_odds_;  // that something stands in a voxel; those of a cell lie together, lowest first
  std::optional<double> begin_;   // [s]
  Image<Stands> stands_;
  Image<int> floor_, below_;            // rays that end on the floor, and that pass below it
  std::vector<uint32_t> hit_, passed_;  // voxels, by the view at work
};

}  // namespace dkb
