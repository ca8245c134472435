// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "bench/bench_suite.h"
#include "dkb/evaluation/trajectory_error.h"

namespace dkb::bench {

// What depends on the machine and its load; all else in a record is a function of program and input.
struct MachineFacts {
  std::optional<double> cv_orb_ms;  // unit of times, measured in the run's own process right after it
  double tracking_ms = 0, tracking_p95_ms = 0, local_ba_ms = 0, keyframe_decision_ms = 0;  // means per frame, keyframe
  double wall_s = 0, cpu_s = 0, peak_mb = 0;
  int parallel_runs = 1, cores = 1;
  std::string program;  // "0.1.0 0123456789abcdef": version and checksum of the executable
};

struct Scores {
  ErrorStatistics translation_m, rotation_deg;
};

// One run as it is kept: a row of the results, also when the run failed.
struct RunRecord {
  std::string sequence, variant;
  int seed = 1;
  std::string failure;  // empty: the run went well; else its last line or the signal that ended it
  int64_t frames = 0, tracked = 0, lost = 0, skipped = 0, keyframes = 0, map_points = 0, map_bytes = 0;
  int64_t maps = 1;                         // that were never joined; trajectory.txt has the frames of the first
  std::optional<Scores> ape;                // of trajectory.txt; nothing without ground truth
  std::optional<Scores> rpe;                // likewise, over one frame
  std::optional<ErrorStatistics> online_m;  // translation of trajectory_online.txt
  MachineFacts machine;

  bool ok() const { return failure.empty(); }
  double tracked_share() const { return frames > 0 ? static_cast<double>(tracked) / static_cast<double>(frames) : 0; }
  // Of the pairs offered, those that `ape` is of: frames of other maps are not, nor are those without a true pose.
  double scored_share() const {
    return frames > 0 && ape ? static_cast<double>(ape->translation_m.count) / static_cast<double>(frames) : 0;
  }
};

std::string record_json(const RunRecord& record);
RunRecord parse_record(const std::string& text, const std::string& name);  // throws InputError

// A folder of results:
//   suite.json                                what was measured
//   runs/SEQUENCE/VARIANT/seed-S.json, .txt   a record, and its trajectory
//   truth/SEQUENCE.txt                        ground truth, for plots
//   sequences/NAME/                           simulated sequences
//   work/                                     runs under way
// Every file is written atomically, a record last, so a bench that is killed at any time loses no finished run, and
// several benches may work in one folder.
class ResultsFolder {
 public:
  // Makes it, or goes on with it; what was chosen adds up. Throws InputError when it holds results of another suite, or
  // other files.
  static ResultsFolder open(const std::filesystem::path& path, SuiteText text, const Suite& suite);
  // One that exists. Throws InputError when it is none.
  static ResultsFolder read(const std::filesystem::path& path);
  static bool is_one(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }
  const Suite& suite() const { return suite_; }
  const SuiteText& text() const { return text_; }

  std::filesystem::path record_path(const Job& job) const;
  std::filesystem::path trajectory_path(const Job& job) const;
  std::filesystem::path truth_path(size_t sequence) const;
  // Nothing when the run has not finished yet. Throws InputError for a file that is not a record of this run.
  std::optional<RunRecord> record(const Job& job) const;
  // Throws OutputError.
  void save(const Job& job, const RunRecord& record, const std::string& trajectory) const;

 private:
  ResultsFolder(std::filesystem::path path, SuiteText text, Suite suite)
      : path_(std::move(path)), text_(std::move(text)), suite_(std::move(suite)) {}
  std::filesystem::path path_;
  SuiteText text_;
  Suite suite_;
};

// Copies into `to` what the results folder `from` has and `to` has not; both must be of one suite (InputError).
void merge_into(const ResultsFolder& to, const ResultsFolder& from);

}  // namespace dkb::bench
