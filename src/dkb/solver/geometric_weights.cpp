// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/geometric_weights.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "dkb/solver/pose_optimiser.h"
#include "dkb/util/chi_square.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr double kMostAdaptive = 2;          // largest adaptive weight, and its inverse the smallest
constexpr double kAdaptiveRedundancy = 200;  // redundant measurements at which its estimate counts half

// Three centres are always in a plane.
constexpr int kMinObservers = 4;
constexpr double kMinTheta = 1e-8;  // [m^2]

struct Observers {
  std::vector<int> cameras, first;  // of point p: cameras[first[p]] ... cameras[first[p + 1] - 1], rising
};

// A keyframe counts once for a point, however often it observes it.
Observers observers_of(const BaProblem& problem) {
  Observers all;
  std::vector<int> next(problem.points.size() + 1, 0);
  for (const BaObservation& o : problem.observations) ++next[static_cast<size_t>(o.point) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<int> cameras(problem.observations.size());
  const std::vector<int> begin = next;
  for (const BaObservation& o : problem.observations)
    cameras[static_cast<size_t>(next[static_cast<size_t>(o.point)]++)] = o.camera;
  all.first.push_back(0);
  for (size_t p = 0; p + 1 < begin.size(); ++p) {
    const auto from = cameras.begin() + begin[p], to = cameras.begin() + begin[p + 1];
    std::sort(from, to);
    all.cameras.insert(all.cameras.end(), from, std::unique(from, to));
    all.first.push_back(static_cast<int>(all.cameras.size()));
  }
  return all;
}

double smallest_eigenvalue(std::span<const Eigen::Vector3d> centres, std::span<const int> observers) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int c : observers) mean += centres[c];
  mean /= static_cast<double>(observers.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const int c : observers) {
    const Eigen::Vector3d d = centres[c] - mean;
    covariance += d * d.transpose();
  }
  covariance /= static_cast<double>(observers.size());
  // In closed form, which is off by 1e-8 of the largest at worst.
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
  eigen.computeDirect(covariance, Eigen::EigenvaluesOnly);
  return std::max(0.0, eigen.eigenvalues()[0]);
}

// Residual variance of one class of points. A point's three coordinates take up three of its measurements' degrees of
// freedom, shared out evenly among them.
struct VarianceComponent {
  double sum = 0;         // of squared pixel residuals in standard deviations
  double redundancy = 0;  // degrees of freedom left to them

  double variance() const { return sum / redundancy; }
};

struct PointResiduals {
  double pixel = 0;
  int pixels = 0, depths = 0;  // measured numbers
};

std::vector<PointResiduals> inlying_residuals(const BaProblem& problem) {
  std::vector<PointResiduals> residuals(problem.points.size());
  for (const BaObservation& o : problem.observations) {
    const Eigen::Vector3d point = problem.cam_from_world[o.camera] * problem.points[o.point];
    if (!(point.z() > kDepthInFront)) continue;
    const double chi2 = ((problem.camera.project(point) - Eigen::Vector2d(o.u, o.v)) * o.inv_sigma).squaredNorm();
    if (!(chi2 <= kChi2TwoDof95)) continue;
    PointResiduals& r = residuals[o.point];
    r.pixel += chi2;
    r.pixels += 2;
    r.depths += o.depth > 0 ? 1 : 0;
  }
  return residuals;
}

double adaptive_edge_weight(const BaProblem& problem, const std::vector<PointShape>& shape) {
  const std::vector<PointResiduals> residuals = inlying_residuals(problem);
  VarianceComponent planar, edge;
  for (size_t p = 0; p < residuals.size(); ++p) {
    const PointResiduals& r = residuals[p];
    const int measured = r.pixels + r.depths;
    if (measured <= 3) continue;
    VarianceComponent& component = shape[p] == PointShape::edge ? edge : planar;
    component.sum += r.pixel;
    component.redundancy += r.pixels * (1.0 - 3.0 / measured);
  }
  if (!(planar.sum > 0) || !(edge.sum > 0)) return 1.0;
  const double redundancy = std::min(planar.redundancy, edge.redundancy);
  const double trust = redundancy / (redundancy + kAdaptiveRedundancy);
  const double weight = std::pow(planar.variance() / edge.variance(), trust);
  return std::clamp(weight, 1 / kMostAdaptive, kMostAdaptive);
}

}  // namespace

GeometricWeights classify_points(std::span<const Eigen::Vector3d> centres_in_world, std::span<const int> observers,
                                 std::span<const int> first, const GeometricWeightOptions& options) {
  if (first.empty() || first.front() != 0 || first.back() != static_cast<int>(observers.size()) ||
      !std::is_sorted(first.begin(), first.end())) {
    throw InputError("geometric weights: `first` must rise from 0 to the number of observers");
  }
  const size_t points = first.size() - 1;
  GeometricWeights weights;
  weights.edge_weight = options.edge_weight;
  weights.shape.assign(points, PointShape::planar);
  weights.lambda3.assign(points, 0.0);
  if (points == 0) return weights;
  for (size_t p = 0; p < points; ++p) {
    const auto own = observers.subspan(first[p], first[p + 1] - first[p]);
    if (own.size() >= kMinObservers) weights.lambda3[p] = smallest_eigenvalue(centres_in_world, own);
  }
  const double n = static_cast<double>(points);
  const double mean = std::accumulate(weights.lambda3.begin(), weights.lambda3.end(), 0.0) / n;
  double variance = 0;
  for (const double lambda : weights.lambda3) variance += (lambda - mean) * (lambda - mean) / n;
  weights.theta_planar = mean + std::sqrt(variance);
  if (weights.theta_planar < kMinTheta) return weights;
  for (size_t p = 0; p < points; ++p) {
    if (weights.lambda3[p] <= weights.theta_planar) continue;
    weights.shape[p] = PointShape::edge;
    ++weights.edges;
  }
  return weights;
}

GeometricWeights set_geometric_weights(BaProblem& problem, const GeometricWeightOptions& options) {
  std::vector<Eigen::Vector3d> centres;
  for (const Rigid3& pose : problem.cam_from_world) centres.push_back(centre_in_world(pose));
  for (const BaObservation& o : problem.observations)
    if (o.point < 0 || o.point >= static_cast<int>(problem.points.size()) || o.camera < 0 ||
        o.camera >= static_cast<int>(centres.size())) {
      throw InputError("geometric weights: an observation names camera " + std::to_string(o.camera) + " and point " +
                       std::to_string(o.point) + ", which do not both exist");
    }
  const auto [observers, first] = observers_of(problem);
  GeometricWeights weights = classify_points(centres, observers, first, options);
  if (options.adaptive) weights.edge_weight = adaptive_edge_weight(problem, weights.shape);
  for (BaObservation& o : problem.observations) o.weight = weights.weight(o.point);
  return weights;
}

}  // namespace dkb
