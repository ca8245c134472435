// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment of local windows and the tracker's pose against plain Ceres (automatic derivatives, dense Schur
// complement, one thread), to the same stopping rule.  Usage: local_ba_bench [repetitions]
#include <fmt/core.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "dkb/solver/ceres_oracle.h"
#include "dkb/solver/test_world.h"
#include "dkb/util/timing.h"

namespace {

using namespace dkb;

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

void compare(const char* name, const TestWorldOptions& options, int repetitions, bool with_ceres) {
  const TestWorld world(options);
  BaOptions ba;
  ba.rounds = {50};
  ba.relative_tolerance = 1e-5;
  std::vector<double> ours, rounds, theirs;
  BaResult result;
  CeresBa ceres;
  for (int k = 0; k < repetitions; ++k) {
    BaProblem problem = world.problem;
    const Stopwatch watch;
    result = bundle_adjust(problem, ba);
    ours.push_back(watch.ms());
  }
  for (int k = 0; k < repetitions; ++k) {
    BaProblem problem = world.problem;
    const Stopwatch watch;
    bundle_adjust(problem);
    rounds.push_back(watch.ms());
  }
  for (int k = 0; with_ceres && k < std::max(1, repetitions / 5); ++k) {
    BaProblem problem = world.problem;
    ceres = ceres_bundle_adjust(problem, {.relative_tolerance = 1e-5});
    theirs.push_back(ceres.solve_ms);
  }
  fmt::print(
      "{:>10} {:>4} cameras {:>6} points {:>7} obs | {:8.2f} ms, {:2d} it, cost {:10.1f} | default rounds {:8.2f} ms",
      name, options.cameras, options.points, world.problem.observations.size(), median(ours), result.iterations,
      result.final_cost, median(rounds));
  if (with_ceres) {
    fmt::print(" | Ceres {:8.1f} ms, {:2d} it, cost {:10.1f} | x{:.1f}", median(theirs), ceres.iterations,
               ceres.final_cost, median(theirs) / median(ours));
  }
  fmt::print("\n");
}

void pose(int repetitions) {
  const TestWorld world({.cameras = 3, .points = 1100, .outlier_share = 0.15});
  const auto observations = world.pose_observations(2);
  std::vector<double> times;
  PoseEstimate estimate;
  for (int k = 0; k < 20 * repetitions; ++k) {
    const Rigid3 start =
        Rigid3(rotation_from_vector({0.01, -0.02, 0.01}), {0.02, 0.01, -0.02}) * world.cam_from_world[2];
    const Stopwatch watch;
    estimate = optimise_pose(world.problem.camera, start, observations);
    times.push_back(watch.ms());
  }
  fmt::print("pose of {} observations, {} inliers, {} iterations: {:.3f} ms\n", observations.size(), estimate.inliers,
             estimate.iterations, median(times));
}

}  // namespace

int main(int argc, char** argv) {
  const int repetitions = argc > 1 ? std::atoi(argv[1]) : 20;
  pose(repetitions);
  compare("small", {.cameras = 20, .fixed = 10, .points = 1500, .visibility = 0.5, .seed = 2}, repetitions, true);
  compare("typical", {.cameras = 32, .fixed = 20, .points = 2500, .visibility = 0.4, .seed = 3}, repetitions, true);
  compare("large", {.cameras = 45, .fixed = 30, .points = 3000, .visibility = 0.5, .seed = 4}, repetitions, true);
  compare("outliers", {.cameras = 32, .fixed = 20, .points = 2500, .outlier_share = 0.05, .visibility = 0.4, .seed = 3},
          repetitions, true);
  compare("global", {.cameras = 1000, .fixed = 1, .points = 50000, .visibility = 0.3, .pose_error = 0.01, .seed = 5}, 1,
          false);
}
