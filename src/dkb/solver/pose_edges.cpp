// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_edges.h"

#include <algorithm>
#include <cmath>

#include "dkb/solver/relative_pose.h"
#include "dkb/util/errors.h"

namespace dkb::solver {

PoseEdges::PoseEdges(const std::vector<PoseEdge>& edges, const std::vector<int>& free_of_camera) : edges_(edges) {
  const int n = static_cast<int>(free_of_camera.size());
  free_ =
      static_cast<size_t>(std::count_if(free_of_camera.begin(), free_of_camera.end(), [](int f) { return f >= 0; }));
  for (const PoseEdge& e : edges) {
    if (e.a < 0 || e.b < 0 || e.a >= n || e.b >= n || e.a == e.b) {
      throw InputError("bundle adjustment: edge from " + std::to_string(e.a) + " to " + std::to_string(e.b) +
                       " does not join two of the " + std::to_string(n) + " poses");
    }
    placed_.push_back({free_of_camera[static_cast<size_t>(e.a)], free_of_camera[static_cast<size_t>(e.b)]});
  }
}

std::vector<std::vector<int>> PoseEdges::later_neighbours() const {
  std::vector<std::vector<int>> later(free_);
  for (const Placed& p : placed_) {
    const auto [low, high] = std::minmax(p.free_a, p.free_b);
    if (low >= 0) later[static_cast<size_t>(low)].push_back(high);
  }
  return later;
}

void PoseEdges::find_blocks(const BlockPattern& pattern) {
  for (Placed& p : placed_) {
    if (p.free_a >= 0) p.block_a = pattern.first[static_cast<size_t>(p.free_a)];
    if (p.free_b >= 0) p.block_b = pattern.first[static_cast<size_t>(p.free_b)];
    const auto [low, high] = std::minmax(p.free_a, p.free_b);
    if (low < 0) continue;
    const auto begin = pattern.rows.begin() + pattern.first[static_cast<size_t>(low)];
    const auto end = pattern.rows.begin() + pattern.first[static_cast<size_t>(low) + 1];
    p.ab = static_cast<int>(std::lower_bound(begin, end, high) - pattern.rows.begin());
  }
}

double PoseEdges::squared_error(size_t k, const std::vector<Rigid3>& poses) const {
  const PoseEdge& e = edges_[k];
  const Vector6d error =
      relative_pose_error(poses[static_cast<size_t>(e.a)], poses[static_cast<size_t>(e.b)], e.b_from_a);
  return error.dot(e.information * error);
}

void PoseEdges::judge(const std::vector<Rigid3>& poses) {
  for (size_t k = 0; k < edges_.size(); ++k) placed_[k].outlier = !(squared_error(k, poses) <= edges_[k].huber_chi2);
}

double PoseEdges::cost(const std::vector<Rigid3>& poses) const {
  double total = 0;
  for (size_t k = 0; k < edges_.size(); ++k) {
    if (placed_[k].outlier) continue;
    const double s = squared_error(k, poses), corner = edges_[k].huber_chi2;
    total += s > corner ? 2 * std::sqrt(corner * s) - corner : s;
  }
  return total;
}

// The information of an edge as its kernel weighs it.
Matrix6d PoseEdges::weighed(const PoseEdge& edge, const Vector6d& error) const {
  const double s = error.dot(edge.information * error);
  return (s > edge.huber_chi2 ? std::sqrt(edge.huber_chi2 / s) : 1.0) * edge.information;
}

void PoseEdges::add(const std::vector<Rigid3>& poses, std::vector<double>& blocks,
                    std::vector<double>& gradient) const {
  const auto block = [&](int entry) {
    return Eigen::Map<Matrix6d>(blocks.data() + kBlockSize * static_cast<size_t>(entry));
  };
  const auto gradient_of = [&](int free) {
    return Eigen::Map<Vector6d>(gradient.data() + 6 * static_cast<size_t>(free));
  };
  for (size_t k = 0; k < edges_.size(); ++k) {
    const PoseEdge& e = edges_[k];
    const Placed& at = placed_[k];
    if (at.outlier) continue;
    const auto r = relative_pose_residual(poses[static_cast<size_t>(e.a)], poses[static_cast<size_t>(e.b)], e.b_from_a);
    const Matrix6d information = weighed(e, r.error);
    const Matrix6d weighted_a = r.jacobian_a.transpose() * information;
    const Matrix6d weighted_b = r.jacobian_b.transpose() * information;
    if (at.free_a >= 0) {
      block(at.block_a) += weighted_a * r.jacobian_a;
      gradient_of(at.free_a) += weighted_a * r.error;
    }
    if (at.free_b >= 0) {
      block(at.block_b) += weighted_b * r.jacobian_b;
      gradient_of(at.free_b) += weighted_b * r.error;
    }
    if (at.ab < 0) continue;
    // The lower triangle's block: its row is the later pose.
    if (at.free_a < at.free_b) {
      block(at.ab) += weighted_b * r.jacobian_a;
    } else {
      block(at.ab) += weighted_a * r.jacobian_b;
    }
  }
}

Matrix6d PoseEdges::propagated(const std::vector<Rigid3>& poses, const PoseColumns& columns) const {
  Matrix6d sum = Matrix6d::Zero();
  for (size_t k = 0; k < edges_.size(); ++k) {
    const PoseEdge& e = edges_[k];
    const Placed& at = placed_[k];
    if (at.outlier) continue;
    const auto r = relative_pose_residual(poses[static_cast<size_t>(e.a)], poses[static_cast<size_t>(e.b)], e.b_from_a);
    Matrix6d moves = Matrix6d::Zero();
    if (at.free_a >= 0) moves += r.jacobian_a * columns.middleRows<6>(6 * at.free_a);
    if (at.free_b >= 0) moves += r.jacobian_b * columns.middleRows<6>(6 * at.free_b);
    sum += moves.transpose() * weighed(e, r.error) * moves;
  }
  return sum;
}

}  // namespace dkb::solver
