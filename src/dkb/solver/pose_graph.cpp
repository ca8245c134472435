// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_graph.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "dkb/solver/block_cholesky.h"
#include "dkb/solver/nielsen_damping.h"
#include "dkb/solver/relative_pose.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

using solver::kBlockSize;

class PoseGraphOptimiser {
 public:
  PoseGraphOptimiser(PoseGraph& graph, const PoseGraphOptions& options)
      : graph_(graph), options_(options), pattern_(find_pattern()), cholesky_(pattern_, solver::solver_kernels()) {
    blocks_.resize(kBlockSize * pattern_.rows.size());
    gradient_.resize(6 * camera_of_free_.size());
  }

  PoseGraphResult run() {
    PoseGraphResult result;
    double present = cost(graph_.cam_from_world);
    result.initial_cost = present;
    solver::NielsenDamping damping(options_.initial_damping, 1e-12);
    bool moved = true;
    while (result.iterations < options_.iterations && !camera_of_free_.empty()) {
      ++result.iterations;
      if (moved) linearise();
      moved = false;
      double predicted = 0;
      const bool solved = solve(damping.value(), predicted);
      if (solved && predicted <= 1e-3 * options_.relative_tolerance * present) break;
      double next = 0;
      if (solved) {
        candidate_ = graph_.cam_from_world;
        for (size_t f = 0; f < camera_of_free_.size(); ++f) {
          Rigid3& pose = candidate_[camera_of_free_[f]];
          pose = solver::perturbed(pose, Eigen::Map<const Vector6d>(step_.data() + 6 * f));
        }
        next = cost(candidate_);
      }
      if (solved && next < present) {
        damping.accept(present - next, predicted);
        std::swap(graph_.cam_from_world, candidate_);
        moved = true;
        const bool done = present - next <= options_.relative_tolerance * present;
        present = next;
        if (done) break;
      } else if (!damping.reject()) {
        break;
      }
    }
    result.final_cost = present;
    return result;
  }

 private:
  // Also checks the graph and numbers the free poses.
  solver::BlockPattern find_pattern() {
    const int n = static_cast<int>(graph_.cam_from_world.size());
    if (graph_.fixed.size() != graph_.cam_from_world.size()) {
      throw InputError("pose graph: " + std::to_string(graph_.fixed.size()) + " fixed flags for " + std::to_string(n) +
                       " poses; give one per pose");
    }
    for (const PoseGraphEdge& e : graph_.edges) {
      if (e.a < 0 || e.b < 0 || e.a >= n || e.b >= n || e.a == e.b) {
        throw InputError("pose graph: edge from " + std::to_string(e.a) + " to " + std::to_string(e.b) +
                         " does not join two of the " + std::to_string(n) + " poses");
      }
    }
    free_of_camera_.assign(n, -1);
    for (int c = 0; c < n; ++c) {
      if (graph_.fixed[c]) continue;
      free_of_camera_[c] = static_cast<int>(camera_of_free_.size());
      camera_of_free_.push_back(c);
    }
    std::vector<std::vector<int>> rows(camera_of_free_.size());
    for (size_t f = 0; f < rows.size(); ++f) rows[f].push_back(static_cast<int>(f));
    for (const PoseGraphEdge& e : graph_.edges) {
      const auto [low, high] = std::minmax(free_of_camera_[e.a], free_of_camera_[e.b]);
      if (low >= 0) rows[low].push_back(high);
    }
    solver::BlockPattern pattern;
    pattern.first.push_back(0);
    for (std::vector<int>& own : rows) {
      std::sort(own.begin(), own.end());
      pattern.rows.insert(pattern.rows.end(), own.begin(), std::unique(own.begin(), own.end()));
      pattern.first.push_back(static_cast<int>(pattern.rows.size()));
    }
    for (const PoseGraphEdge& e : graph_.edges) {
      const auto [low, high] = std::minmax(free_of_camera_[e.a], free_of_camera_[e.b]);
      if (low < 0) {
        edge_block_.push_back(-1);
        continue;
      }
      const auto begin = pattern.rows.begin() + pattern.first[low], end = pattern.rows.begin() + pattern.first[low + 1];
      edge_block_.push_back(static_cast<int>(std::lower_bound(begin, end, high) - pattern.rows.begin()));
    }
    return pattern;
  }

  double cost(const std::vector<Rigid3>& poses) const {
    double total = 0;
    for (const PoseGraphEdge& e : graph_.edges) {
      const Vector6d error = solver::relative_pose_error(poses[e.a], poses[e.b], e.b_from_a);
      const double s = error.dot(e.information * error);
      const bool beyond = e.robust && s > options_.huber_chi2;
      total += beyond ? 2 * std::sqrt(options_.huber_chi2 * s) - options_.huber_chi2 : s;
    }
    return total;
  }

  using Block = Eigen::Map<Matrix6d>;
  Block block(int index) { return Block(blocks_.data() + kBlockSize * static_cast<size_t>(index)); }
  Eigen::Map<Vector6d> gradient_of(int free) { return Eigen::Map<Vector6d>(gradient_.data() + 6 * free); }

  void linearise() {
    std::fill(blocks_.begin(), blocks_.end(), 0.0);
    std::fill(gradient_.begin(), gradient_.end(), 0.0);
    for (size_t k = 0; k < graph_.edges.size(); ++k) {
      const PoseGraphEdge& e = graph_.edges[k];
      const auto r = solver::relative_pose_residual(graph_.cam_from_world[e.a], graph_.cam_from_world[e.b], e.b_from_a);
      const double s = r.error.dot(e.information * r.error);
      const bool beyond = e.robust && s > options_.huber_chi2;
      const Matrix6d information = (beyond ? std::sqrt(options_.huber_chi2 / s) : 1.0) * e.information;
      const Matrix6d weighted_a = r.jacobian_a.transpose() * information;
      const Matrix6d weighted_b = r.jacobian_b.transpose() * information;
      const int a = free_of_camera_[e.a], b = free_of_camera_[e.b];
      if (a >= 0) {
        block(pattern_.first[a]) += weighted_a * r.jacobian_a;
        gradient_of(a) += weighted_a * r.error;
      }
      if (b >= 0) {
        block(pattern_.first[b]) += weighted_b * r.jacobian_b;
        gradient_of(b) += weighted_b * r.error;
      }
      if (edge_block_[k] < 0) continue;
      // The lower triangle's block: its row is the later pose.
      if (a < b) {
        block(edge_block_[k]) += weighted_b * r.jacobian_a;
      } else {
        block(edge_block_[k]) += weighted_a * r.jacobian_b;
      }
    }
  }

  bool solve(double damping, double& predicted) {
    damped_ = blocks_;
    const auto diagonal = [&](size_t i) { return std::max(block(pattern_.first[i / 6])(i % 6, i % 6), 1e-9); };
    for (size_t i = 0; i < gradient_.size(); ++i) {
      damped_[kBlockSize * static_cast<size_t>(pattern_.first[i / 6]) + 7 * (i % 6)] += damping * diagonal(i);
    }
    if (!cholesky_.factorise(damped_)) return false;
    step_ = gradient_;
    cholesky_.solve(step_);
    predicted = 0;
    for (size_t i = 0; i < step_.size(); ++i) {
      step_[i] = -step_[i];
      predicted += damping * diagonal(i) * step_[i] * step_[i] - gradient_[i] * step_[i];
    }
    return std::isfinite(predicted);
  }

  PoseGraph& graph_;
  const PoseGraphOptions& options_;
  std::vector<int> free_of_camera_;  // -1 = fixed
  std::vector<int> camera_of_free_;
  std::vector<int> edge_block_;  // -1 = one pose is fixed
  const solver::BlockPattern pattern_;
  solver::BlockCholesky cholesky_;
  std::vector<double> blocks_, damped_, gradient_, step_;
  std::vector<Rigid3> candidate_;
};

}  // namespace

void PoseGraphOptions::check() const {
  require_option(iterations >= 1, "iterations", iterations, ">= 1");
  require_option(huber_chi2 > 0, "huber_chi2", huber_chi2, "> 0");
  require_option(initial_damping > 0, "initial_damping", initial_damping, "> 0");
  require_option(relative_tolerance >= 0, "relative_tolerance", relative_tolerance, ">= 0");
}

PoseGraphResult optimise_pose_graph(PoseGraph& graph, const PoseGraphOptions& options) {
  options.check();
  return PoseGraphOptimiser(graph, options).run();
}

}  // namespace dkb
