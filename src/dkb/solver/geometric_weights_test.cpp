// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/geometric_weights.h"

#include <gtest/gtest.h>

#include "dkb/solver/test_world.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Six centres on the axes at distance a: covariance diag(a^2, a^2, a^2) / 3.
const std::vector<Eigen::Vector3d> kOctahedron = {{0.3, 0, 0},  {-0.3, 0, 0}, {0, 0.3, 0},
                                                  {0, -0.3, 0}, {0, 0, 0.3},  {0, 0, -0.3}};

TEST(GeometricWeights, LambdaIsTheSmallestEigenvalueOfTheCentres) {  // DKB eqs. 45, 46
  const std::vector<int> observers = {0, 1, 2, 3, 4, 5, 0, 1, 2, 3}, first = {0, 6, 10};
  const GeometricWeights w = classify_points(kOctahedron, observers, first);
  EXPECT_NEAR(w.lambda3[0], 0.09 / 3, 1e-15);
  EXPECT_NEAR(w.lambda3[1], 0, 1e-15);  // four centres in a plane
}

TEST(GeometricWeights, ThresholdIsMeanPlusDeviationAndEdgesAreBeyondIt) {  // DKB eq. 47
  // lambda3 = 0.03 once and 0 nine times: mean 0.003, deviation sqrt(0.0009 / 10 - 0.000009) = 0.009.
  std::vector<int> observers = {0, 1, 2, 3, 4, 5}, first = {0, 6};
  for (int k = 0; k < 9; ++k) {
    observers.insert(observers.end(), {0, 1, 2, 3});
    first.push_back(static_cast<int>(observers.size()));
  }
  const GeometricWeights w = classify_points(kOctahedron, observers, first, {.edge_weight = 1.4});
  EXPECT_NEAR(w.theta_planar, 0.012, 1e-12);
  EXPECT_EQ(w.shape[0], PointShape::edge);
  EXPECT_EQ(w.edges, 1);
  EXPECT_EQ(w.weight(0), 1.4);
  EXPECT_EQ(w.weight(1), 1.0);
}

TEST(GeometricWeights, DegenerateClassesArePlanar) {
  // One point seen from all around, ones seen by three keyframes and by one: lambda3 is 0 for these.
  std::vector<int> seen_by = {0, 1, 2, 3, 4, 5}, begin = {0, 6};
  for (int k = 0; k < 4; ++k) {
    seen_by.insert(seen_by.end(), {0, 2, 4});
    begin.push_back(static_cast<int>(seen_by.size()));
    seen_by.push_back(k);
    begin.push_back(static_cast<int>(seen_by.size()));
  }
  const GeometricWeights few = classify_points(kOctahedron, seen_by, begin);
  EXPECT_EQ(few.edges, 1);
  for (size_t p = 1; p < few.shape.size(); ++p) {
    EXPECT_NEAR(few.lambda3[p], 0, 1e-15) << p;
    EXPECT_EQ(few.shape[p], PointShape::planar) << p;
  }
  // A threshold below 1e-8 m^2.
  std::vector<Eigen::Vector3d> tight = kOctahedron;
  for (Eigen::Vector3d& c : tight) c *= 1e-4;
  std::vector<int> observers = {0, 1, 2, 3, 4, 5}, first = {0, 6, 6, 6, 6};
  EXPECT_EQ(classify_points(kOctahedron, observers, first).edges, 1);
  EXPECT_EQ(classify_points(tight, observers, first).edges, 0);
  // Equal values: none is beyond mean + 0.
  EXPECT_EQ(classify_points(kOctahedron, observers, std::vector<int>{0, 6}).edges, 0);
  EXPECT_EQ(classify_points(kOctahedron, {}, std::vector<int>{0}).edges, 0);
}

TEST(GeometricWeights, RefusesListsThatDoNotFit) {
  EXPECT_THROW(classify_points(kOctahedron, std::vector<int>{0, 1}, std::vector<int>{0, 3}), InputError);
}

TEST(GeometricWeights, AreWrittenToAllObservationsOfAPoint) {  // DKB eq. 48
  TestWorld world({.cameras = 10, .points = 300, .visibility = 0.6, .seed = 3});
  // A second observation by the same keyframe is no second observer.
  world.problem.observations.push_back(world.problem.observations.front());
  const GeometricWeights w = set_geometric_weights(world.problem, {.adaptive = false});
  EXPECT_GT(w.edges, 0);
  EXPECT_LT(w.edges, 150);
  for (const BaObservation& o : world.problem.observations) {
    EXPECT_EQ(o.weight, w.shape[o.point] == PointShape::edge ? 1.5 : 1.0);
  }
}

// What set_geometric_weights() makes of a world where the residuals of planar points have so many times the variance of
// those of edge points.
double adaptive_weight(int cameras, int points, double ratio) {
  TestWorld world({.cameras = cameras,
                   .points = points,
                   .pixel_noise = 0,
                   .depth_noise = 0.01,
                   .visibility = 0.5,
                   .pose_error = 0,
                   .point_error = 0,
                   .seed = 3});
  const GeometricWeights shapes = set_geometric_weights(world.problem);
  Random random(5);
  // Noise of 0.7 sigma at most, so that few are cut off.
  for (BaObservation& o : world.problem.observations) {
    const double share = shapes.shape[static_cast<size_t>(o.point)] == PointShape::edge ? 1 / std::sqrt(ratio) : 1;
    const double sigma = 0.7 * share / o.inv_sigma;
    o.u += sigma * random.normal();
    o.v += sigma * random.normal();
  }
  return set_geometric_weights(world.problem).edge_weight;
}

TEST(GeometricWeights, AdaptiveWeightIsTheRatioOfTheVariancesWithinHalfAndTwo) {
  EXPECT_NEAR(adaptive_weight(14, 1500, 1.5), 1.5, 0.1);
  EXPECT_NEAR(adaptive_weight(14, 1500, 1 / 1.5), 1 / 1.5, 0.1);
  EXPECT_EQ(adaptive_weight(14, 1500, 4), 2);
}

TEST(GeometricWeights, AdaptiveWeightIsNearOneWhereLittleIsMeasured) {
  const double weight = adaptive_weight(8, 15, 4);
  EXPECT_GT(weight, 1);
  EXPECT_LT(weight, 1.5);
}

}  // namespace
}  // namespace dkb
