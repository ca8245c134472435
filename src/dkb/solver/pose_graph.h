// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/solver/pose_edges.h"

namespace dkb {

struct PoseGraph {
  std::vector<Rigid3> cam_from_world;
  std::vector<uint8_t> fixed;  // per keyframe; at least one of each connected part ought to be fixed
  std::vector<PoseEdge> edges;
};

struct PoseGraphOptions {
  int iterations = 20;               // Levenberg-Marquardt steps, >= 1
  double initial_damping = 1e-6;     // Marquardt's factor on the diagonal at the start, > 0
  double relative_tolerance = 1e-6;  // a step that lowers the cost by less than this part is the last, >= 0

  void check() const;  // throws InvalidOption
};

struct PoseGraphResult {
  double initial_cost = 0, final_cost = 0;  // sum of rho(d^T information d)
  int iterations = 0;
};

// Refines the free poses of `graph` in place (block-sparse Cholesky factorisation). Deterministic.
// Throws InputError for indices or sizes that do not fit.
PoseGraphResult optimise_pose_graph(PoseGraph& graph, const PoseGraphOptions& options = {});

}  // namespace dkb
