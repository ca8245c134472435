// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dkb/dataset/trajectory_file.h"
#include "dkb/evaluation/trajectory_error.h"
#include "report/lost_stretches.h"
#include "report/run_log.h"

namespace dkb::report {

// The preset, and settings that are not what they are by default; experiments that were set.
std::vector<Setting> changed_settings(const Options& options);

// What a run says of itself at its end.
struct ReportFacts {
  std::string name;                                          // of the recording
  std::string source;                                        // what is read, for people
  std::string version;                                       // of the program
  std::vector<std::pair<std::string, std::string>> choices;  // how it was started: camera, detector ...
  Camera camera;
  bool realtime = false;                               // frames came at the pace of their stamps
  int offered = 0, skipped = 0;                        // as in stats.json
  double wall_s = 0;                                   // likewise
  Statistics statistics;                               // with the stages of all threads
  Trajectory trajectory;                               // of the first map, as in trajectory.txt
  std::vector<size_t> poses_of_map;                    // in trajectory.txt, trajectory_map2.txt ...
  std::vector<Eigen::Vector3d> map_points, keyframes;  // [m] of the first map, where its points and cameras are
  std::optional<OccupancyGrid> grid;                   // of the first map, with a dense map and a floor
  std::vector<Setting> settings;                       // by changed_settings()
  CauseLimits limits;
  uint64_t seed = 1;  // picks the random pictures

  void take_map(const MapSnapshot& map);  // points and keyframes
};

// The truth that lies beside a recording.
struct Truth {
  Trajectory poses;
  std::optional<Evaluation> evaluation;  // of the trajectory, as `eval` makes it
  std::string note;                      // why there is none
  size_t hidden = 0;                     // rows with nan, left out
};
// By truth_beside(source); without one all is empty. A file that cannot be used is a note and no error.
Truth evaluated_by_truth(const std::string& source, const Trajectory& trajectory);

// One page, complete without script and network. What a clock had a say in stands between <!--clock--> and
// <!--/clock-->; the rest is the same in every run.
std::string report_html(const RunLog& log, const ReportFacts& facts, const Truth& truth);

}  // namespace dkb::report
