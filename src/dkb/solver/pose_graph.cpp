// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_graph.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "dkb/solver/block_cholesky.h"
#include "dkb/solver/nielsen_damping.h"
#include "dkb/solver/pose_edges.h"
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
    double present = edges_->cost(graph_.cam_from_world);
    result.initial_cost = present;
    solver::NielsenDamping damping(options_.initial_damping, 1e-12);
    bool moved = true;
    while (result.iterations < options_.iterations && !camera_of_free_.empty()) {
      ++result.iterations;
      if (moved) {
        std::fill(blocks_.begin(), blocks_.end(), 0.0);
        std::fill(gradient_.begin(), gradient_.end(), 0.0);
        edges_->add(graph_.cam_from_world, blocks_, gradient_);
      }
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
        next = edges_->cost(candidate_);
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
    free_of_camera_.assign(n, -1);
    for (int c = 0; c < n; ++c) {
      if (graph_.fixed[c]) continue;
      free_of_camera_[c] = static_cast<int>(camera_of_free_.size());
      camera_of_free_.push_back(c);
    }
    edges_.emplace(graph_.edges, free_of_camera_, "pose graph");
    std::vector<std::vector<int>> rows = edges_->later_neighbours();
    for (size_t f = 0; f < rows.size(); ++f) rows[f].push_back(static_cast<int>(f));
    solver::BlockPattern pattern;
    pattern.first.push_back(0);
    for (std::vector<int>& own : rows) {
      std::sort(own.begin(), own.end());
      pattern.rows.insert(pattern.rows.end(), own.begin(), std::unique(own.begin(), own.end()));
      pattern.first.push_back(static_cast<int>(pattern.rows.size()));
    }
    edges_->find_blocks(pattern);
    return pattern;
  }

  using Block = Eigen::Map<Matrix6d>;
  Block block(int index) { return Block(blocks_.data() + kBlockSize * static_cast<size_t>(index)); }

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
  std::optional<solver::PoseEdges> edges_;
  const solver::BlockPattern pattern_;
  solver::BlockCholesky cholesky_;
  std::vector<double> blocks_, damped_, gradient_, step_;
  std::vector<Rigid3> candidate_;
};

}  // namespace

void PoseGraphOptions::check() const {
  require_option(iterations >= 1, "iterations", iterations, ">= 1");
  require_option(initial_damping > 0, "initial_damping", initial_damping, "> 0");
  require_option(relative_tolerance >= 0, "relative_tolerance", relative_tolerance, ">= 0");
}

PoseGraphResult optimise_pose_graph(PoseGraph& graph, const PoseGraphOptions& options) {
  options.check();
  return PoseGraphOptimiser(graph, options).run();
}

}  // namespace dkb
