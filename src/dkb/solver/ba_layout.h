// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "dkb/solver/block_cholesky.h"
#include "dkb/solver/bundle_adjustment.h"
#include "dkb/solver/pose_edges.h"

namespace dkb::solver {

// Where everything of a bundle adjustment lies in memory; fixed for all of its iterations.
//
// Observations stand camera by camera (within a camera by point), each camera's filled up to a multiple of four with
// entries of no weight that belong to an extra point and an extra pair. (point, free camera) pairs stand point by
// point, cameras ascending.
struct BaLayout {
  // Throws InputError for indices that do not fit.
  explicit BaLayout(const BaProblem& problem);

  int cameras, points;
  std::vector<int> free_of_camera;  // -1 = fixed
  std::vector<int> camera_of_free;
  std::vector<int> camera_first;          // per camera, cameras + 1 entries: its observations
  std::vector<int> observation_of_entry;  // -1 = filling
  std::vector<int> point_of_entry;        // `points` for filling
  std::vector<int> pair_of_entry;         // the number of pairs for filling, and for fixed cameras
  std::vector<int> pair_first;            // per point, points + 1 entries
  std::vector<int> pair_camera;           // free camera
  // Camera system: lower triangle by columns; block of each two pairs (a <= b) of a point, row by row.
  BlockPattern pattern;
  std::vector<long long> block_first;  // per point, points + 1 entries
  std::vector<int> block;
  std::optional<PoseEdges> motions;  // of the problem

  int pairs() const { return static_cast<int>(pair_camera.size()); }
  int free_cameras() const { return static_cast<int>(camera_of_free.size()); }

 private:
  void check(const BaProblem& problem) const;
  void sort_observations(const BaProblem& problem);
  void number_pairs();
  void find_blocks();
};

}  // namespace dkb::solver
