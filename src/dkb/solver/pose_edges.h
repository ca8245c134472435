// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/solver/block_cholesky.h"

namespace dkb {

// Measured motion between two keyframes: cam_b_from_world * world_from_cam_a = b_from_a * T(d), with
// d = [translation m, rotation rad] in the axes of a, of this information (inverse covariance).
struct PoseEdge {
  int a = 0, b = 0;  // indices of poses, a != b
  Rigid3 b_from_a;
  Matrix6d information = Matrix6d::Identity();
  double huber_chi2 = std::numeric_limits<double>::infinity();  // corner of the Huber kernel on d^T information d
};

}  // namespace dkb

namespace dkb::solver {

// Six numbers that follow from those of the free poses, by these: 6 rows per free pose.
using PoseColumns = Eigen::Matrix<double, Eigen::Dynamic, 6>;

// What edges between poses add to a least-squares problem in the poses: cost, gradient, and 6x6 blocks of the normal
// equations by right perturbations of world_from_cam. Deterministic.
class PoseEdges {
 public:
  // `free_of_camera`: number of each pose among the free ones, -1 = fixed. Throws InputError for edges that do not join
  // two of the poses.
  PoseEdges(const std::vector<PoseEdge>& edges, const std::vector<int>& free_of_camera);

  // Per free pose, the free ones behind it that an edge joins it with; may repeat.
  std::vector<std::vector<int>> later_neighbours() const;
  // Where the blocks lie; the pattern must hold all of them.
  void find_blocks(const BlockPattern& pattern);

  // Leaves out, until it is called again, the edges that these poses contradict beyond the corner of their kernels.
  void judge(const std::vector<Rigid3>& cam_from_world);
  double cost(const std::vector<Rigid3>& cam_from_world) const;
  // Adds to the blocks of the pattern and to the gradient (6 numbers per free pose).
  void add(const std::vector<Rigid3>& cam_from_world, std::vector<double>& blocks, std::vector<double>& gradient) const;
  // columns^T E columns, E the blocks that add() adds.
  Matrix6d propagated(const std::vector<Rigid3>& cam_from_world, const PoseColumns& columns) const;

 private:
  double squared_error(size_t k, const std::vector<Rigid3>& cam_from_world) const;
  struct Placed {
    int free_a, free_b;                       // -1 = fixed
    int block_a = -1, block_b = -1, ab = -1;  // entries of the pattern
    bool outlier = false;
  };
  Matrix6d weighed(const PoseEdge& edge, const Vector6d& error) const;

  const std::vector<PoseEdge>& edges_;
  size_t free_ = 0;
  std::vector<Placed> placed_;
};

}  // namespace dkb::solver
