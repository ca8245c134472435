// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/util/errors.h"
#include "dkb/util/timing.h"
#include "dkb_slam/slam.h"

namespace dkb {

// Facts of a run that the system itself does not know.
struct RunFacts {
  std::vector<std::string> stamps;  // colour stamp of each frame given to the system, as read
  int offered = 0, skipped = 0;     // pairs of the selection; those never given to the system
  double startup_s = 0, wall_s = 0;
  std::string config_yaml;
  std::string run_json;  // what was run
  std::string model;     // file name of the network, should there be one
  bool interrupted = false;
  std::vector<size_t> poses_of_map;  // in trajectory.txt, trajectory_map2.txt ...
  StageTimes times;                  // of stages that the system does not have
  bool writes_map = true;
  std::optional<int> dropped;  // of `skipped`, in real time: those for which there was no time
};

// Of a folder, a recording or the kind of a device, without the way there.
std::string source_name(const std::filesystem::path& source);

// The folder of a run's results: `out`, or a new one below dkb-out that is named by the source and the time. It exists
// then, and files can be written there: throws InputError, also where a folder has the name of a file that runs write.
std::filesystem::path make_results_folder(const std::string& out, const std::filesystem::path& source);

// Does work that writes results, after a run that began well: what then cannot be written is no bad input.
template <class Work>
void write_results(const Work& work) {
  try {
    work();
  } catch (const OutputError&) {
    throw;
  } catch (const InputError& e) {
    throw OutputError(e.what());
  }
}

// Seconds since this process was started, by the kernel's account.
double seconds_since_process_start();

// The system's statistics, with the stages that it does not have.
Statistics statistics_with(const Slam& slam, const RunFacts& facts);

// Writes every result of the contract but stats.json and those of FrameFiles into `folder`, each file atomically;
// `trajectories` are Slam's by map, which takes a moment to smooth. Throws OutputError.
void write_outputs(const std::filesystem::path& folder, const Slam& slam, const std::vector<Trajectory>& trajectories,
                   const RunFacts& facts);

// stats.json. Throws OutputError.
void write_statistics(const std::filesystem::path& folder, const Slam& slam, const RunFacts& facts);

// Removes what an earlier run left in `folder` and this one does not have: of the files that not every run writes,
// those that are not among `written`.
void remove_earlier_outputs(const std::filesystem::path& folder, const std::set<std::string>& written);

// dense.ply, and occupancy.pgm and occupancy.yaml when there is a floor. Returns a line for the user. Throws
// OutputError.
std::string write_dense_map(const std::filesystem::path& folder, const DenseMap& map, double seconds);

}  // namespace dkb
