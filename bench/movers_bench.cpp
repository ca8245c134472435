// SPDX-License-Identifier: Apache-2.0
// How well a run followed the movers of a simulated sequence, against the simulator's movers.csv: who was found, where
// they were placed, and whether ids lasted when one passed another.
//
//   dkb-slam simulate --scene crowd --out crowd && dkb-slam run crowd --detector motion --out run
//   movers_bench crowd run [RUN ...]
#include <fmt/format.h>

#include <filesystem>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/util/errors.h"
#include "figures.h"
#include "mover_evaluation.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

const StampedPose* pose_at(const Trajectory& poses, double time) {
  for (const StampedPose& p : poses)
    if (std::abs(p.timestamp - time) < 1e-4) return &p;
  return nullptr;
}

Rigid3 truth_from_run(const Trajectory& truth, const Trajectory& run) {
  std::vector<std::pair<Rigid3, Rigid3>> pairs;
  for (const StampedPose& p : run)
    if (const StampedPose* t = pose_at(truth, p.timestamp)) pairs.emplace_back(p.world_from_cam, t->world_from_cam);
  if (pairs.empty()) throw InputError("no pose of the run has a stamp of the truth");
  return registration(pairs);
}

void measure(const fs::path& sequence, const fs::path& run) {
  const Trajectory truth = read_trajectory((sequence / "groundtruth.txt").string());
  const Rigid3 truth_from_world = truth_from_run(truth, read_trajectory((run / "trajectory_online.txt").string()));
  const auto camera = [&](double time) {
    const StampedPose* p = pose_at(truth, time);
    return p != nullptr ? p->world_from_cam.translation : Eigen::Vector3d(1e9, 0, 0);
  };
  const MoverEvaluation e =
      evaluate_movers(read_movers(sequence / "movers.csv"), read_movers(run / "movers.csv"), truth_from_world, camera);
  fmt::print(
      "{}: found {} of {} ({:.0f}%), {} false; position error median {:.1f} cm, {:.0f}% within 2 sd, velocity {:.2f} "
      "m/s, NEES {:.2f}; kept {} of {} ids at crossings ({:.0f}%), {} ids\n",
      run.filename().string(), e.found, e.true_movers,
      100.0 * static_cast<double>(e.found) / std::max<double>(1, static_cast<double>(e.true_movers)), e.false_movers,
      100 * e.median_position_error, 100 * e.share_within_two_sd, e.median_velocity_error, e.mean_velocity_nees, e.kept,
      e.crossings, 100 * e.kept_share(), e.ids);
}

}  // namespace
}  // namespace dkb

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: movers_bench SEQUENCE RUN [RUN ...]\n");
    return 2;
  }
  try {
    for (int i = 2; i < argc; ++i) dkb::measure(argv[1], argv[i]);
  } catch (const dkb::InputError& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 2;
  }
}
