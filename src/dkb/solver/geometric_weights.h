// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/solver/bundle_adjustment.h"

namespace dkb {

struct GeometricWeightOptions {
  // The ratio of the two classes' residual variances, estimated from the residuals, instead of the fixed edge_weight.
  // Measures better over many seeds (docs/benchmarks.md).
  bool adaptive = true;
  double edge_weight = 1.5;  // w of edge points where not adaptive, (0, 10]; planar points have 1      (DKB Table 1)
};

enum class PointShape : uint8_t { planar, edge };

struct GeometricWeights {
  std::vector<PointShape> shape;  // per point
  std::vector<double> lambda3;    // [m^2] smallest eigenvalue of the covariance of the observers' centres, >= 0
  double theta_planar = 0;        // [m^2] DKB eq. 47
  double edge_weight = 1;         // what edge points get
  int edges = 0;

  double weight(size_t point) const { return shape[point] == PointShape::edge ? edge_weight : 1.0; }
};

// Planar and edge points by the spread of the camera centres that observe them (DKB eqs. 45-47). The observers of
// point p are observers[first[p]] ... observers[first[p + 1] - 1], indices into `centres_in_world` [m]; first has one
// entry more than there are points. Fewer than 4 observers, lambda3 <= theta_planar, or theta_planar < 1e-8 m^2:
// planar. edge_weight of the result is that of the options (the fixed one).
GeometricWeights classify_points(std::span<const Eigen::Vector3d> centres_in_world, std::span<const int> observers,
                                 std::span<const int> first, const GeometricWeightOptions& options = {});

// Classifies the points of a problem by all of its observations and writes BaObservation::weight. With
// options.adaptive the edge weight is the ratio of the variances of planar and edge residuals at the present state
// (variance components of two groups), drawn toward 1 where few measurements are redundant, between a half
// and two.
GeometricWeights set_geometric_weights(BaProblem& problem, const GeometricWeightOptions& options = {});

}  // namespace dkb
