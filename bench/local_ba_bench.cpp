// SPDX-License-Identifier: Apache-2.0
// The solvers of the map: bundle adjustment of windows against plain Ceres (automatic derivatives, dense Schur
// complement, one thread, the time of its solver without building its problem) from the same start and to the same
// stopping rule; the tracker's pose; a pose graph.  Usage: local_ba_bench [repetitions]
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

#include "dkb/solver/absolute_pose.h"
#include "dkb/solver/bundle_adjustment.h"
#include "dkb/solver/ceres_test_oracle.h"
#include "dkb/solver/geometric_weights.h"
#include "dkb/solver/test_world.h"
#include "dkb/util/timing.h"

namespace {

using namespace dkb;

// Median time [ms] of `run`, each time on a fresh copy.
template <class Problem, class Run>
double median_ms(const Problem& problem, int repetitions, const Run& run) {
  std::vector<double> times;
  for (int k = 0; k < repetitions; ++k) {
    Problem copy = problem;
    const Stopwatch watch;
    run(copy);
    times.push_back(watch.ms());
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

void bench_window(const char* name, const TestWorldOptions& options, int repetitions, bool with_ceres) {
  const TestWorld world(options);
  BaOptions one_round;
  one_round.rounds = {50};
  BaResult result;
  const double ours =
      median_ms(world.problem, repetitions, [&](BaProblem& problem) { result = bundle_adjust(problem, one_round); });
  const double rounds = median_ms(world.problem, repetitions, [&](BaProblem& problem) { bundle_adjust(problem); });
  fmt::print("{:>9} | {:>4} + {:>2} | {:>6} | {:>7} | {:8.2f} | {:2d} | {:10.1f} | {:8.2f} |", name,
             options.cameras - options.fixed, options.fixed, options.points, world.problem.observations.size(), ours,
             result.iterations, result.final_cost, rounds);
  if (with_ceres) {
    CeresBa ceres;
    std::vector<double> times;
    for (int k = 0; k < std::max(1, repetitions / 5); ++k) {
      BaProblem problem = world.problem;
      ceres = ceres_bundle_adjust(problem, {.relative_tolerance = one_round.relative_tolerance});
      times.push_back(ceres.solve_ms);
    }
    std::sort(times.begin(), times.end());
    const double theirs = times[times.size() / 2];
    fmt::print(" {:8.1f} | {:2d} | {:10.1f} | {:5.1f}", theirs, ceres.iterations, ceres.final_cost, theirs / ours);
  }
  fmt::print("\n");
}

void bench_pose(int points, int repetitions) {
  const TestWorld world({.cameras = 3, .points = points, .outlier_share = 0.15});
  const auto observations = world.pose_observations(2);
  const Rigid3 start = Rigid3(rotation_from_vector({0.01, -0.02, 0.01}), {0.02, 0.01, -0.02}) * world.cam_from_world[2];
  PoseEstimate estimate;
  const double ms = median_ms(start, 20 * repetitions, [&](const Rigid3& pose) {
    estimate = optimise_pose(world.problem.camera, pose, observations);
  });
  fmt::print("pose, {} observations, {} inliers: {:.3f} ms\n", observations.size(), estimate.inliers, ms);
  RansacPose ransac;
  const double ransac_ms = median_ms(
      start, repetitions, [&](const Rigid3&) { ransac = estimate_absolute_pose(world.problem.camera, observations); });
  fmt::print("RANSAC pose, {} samples, {} inliers: {:.3f} ms\n", ransac.iterations, ransac.inliers, ransac_ms);
}

void bench_weights(int repetitions) {
  const TestWorld world({.cameras = 32, .fixed = 20, .points = 2500, .visibility = 0.4, .seed = 3});
  const double ms = median_ms(world.problem, repetitions, [](BaProblem& problem) { set_geometric_weights(problem); });
  fmt::print("geometric weights of the typical window: {:.3f} ms\n", ms);
}

// Eight rounds of a circle, joined to the three keyframes before and at random to the round before.
BaProblem rounds_of_a_circle(int keyframes, int closures) {
  constexpr int kRound = 250;
  Random random(3);
  const auto noise = [&](double sigma) {
    Vector6d d;
    for (double& value : d) value = sigma * random.normal();
    return d;
  };
  std::vector<Rigid3> truth;
  for (int k = 0; k < keyframes; ++k) {
    const double a = 2 * M_PI * k / kRound;
    truth.push_back(Rigid3(rotation_from_vector({0, -a, 0}), {3 * std::sin(a), 0, 3 * std::cos(a)}).inverse());
  }
  BaProblem graph;
  const auto join = [&](int a, int b) {
    const Rigid3 b_from_a = truth[b] * truth[a].inverse() * rigid3_from_tangent(noise(0.005));
    graph.motions.push_back({a, b, b_from_a, 4e4 * Matrix6d::Identity()});
  };
  graph.cam_from_world.push_back(truth[0]);
  for (int k = 1; k < keyframes; ++k) {
    graph.cam_from_world.push_back(rigid3_from_tangent(noise(0.01)) * truth[k] * truth[k - 1].inverse() *
                                   graph.cam_from_world[k - 1]);
    for (int d = 1; d <= std::min(3, k); ++d) join(k - d, k);
  }
  for (int k = 0; k < closures; ++k) {
    const int a = static_cast<int>(random.below(keyframes - kRound));
    join(a, a + kRound);
  }
  graph.fixed.assign(keyframes, 0);
  graph.fixed[0] = 1;
  return graph;
}

void bench_pose_graph(int repetitions) {
  const BaProblem graph = rounds_of_a_circle(2000, 2000);
  BaResult result;
  const double ms =
      median_ms(graph, repetitions, [&](BaProblem& copy) { result = bundle_adjust(copy, BaOptions::of_pose_graph()); });
  fmt::print("pose graph, {} keyframes, {} edges, {} iterations, cost {:.0f} to {:.0f}: {:.1f} ms\n",
             graph.cam_from_world.size(), graph.motions.size(), result.iterations, result.initial_cost,
             result.final_cost, ms);
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = std::max(1, argc > 1 ? std::atoi(argv[1]) : 20);
  bench_pose(600, repetitions);
  bench_weights(repetitions);
  bench_pose_graph(std::max(1, repetitions / 5));
  fmt::print(
      "   window | free + fixed | points | observations | ms | iterations | cost | default rounds, ms | Ceres, ms | "
      "iterations | cost | times\n");
  bench_window("small", {.cameras = 20, .fixed = 10, .points = 1500, .visibility = 0.5, .seed = 2}, repetitions, true);
  bench_window("typical", {.cameras = 32, .fixed = 20, .points = 2500, .visibility = 0.4, .seed = 3}, repetitions,
               true);
  bench_window("large", {.cameras = 45, .fixed = 30, .points = 3000, .visibility = 0.5, .seed = 4}, repetitions, true);
  bench_window("outliers",
               {.cameras = 32, .fixed = 20, .points = 2500, .outlier_share = 0.05, .visibility = 0.4, .seed = 3},
               repetitions, true);
  bench_window("global",
               {.cameras = 1000, .fixed = 1, .points = 50000, .visibility = 0.3, .pose_error = 0.01, .seed = 5}, 1,
               false);
}
