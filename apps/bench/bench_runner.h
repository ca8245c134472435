// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "bench/bench_results.h"

namespace dkb::bench {

struct RunnerOptions {
  int parallel = 1;                    // runs at a time, >= 1
  std::filesystem::path program;       // the dkb-slam that runs; empty: this one
  std::string data;                    // folder of the sequences instead of the suite's root; empty: the suite's
  std::filesystem::path suite_folder;  // what relative paths of the suite start from
  bool retry = false;                  // repeat runs that failed
  bool quiet = false;                  // no progress
  void check() const;                  // throws InvalidOption
};

// What a suite needs that is not on this machine, and so was left out.
struct LeftOut {
  std::string what, why, get;
};

struct RunnerReport {
  int done = 0, failed = 0, reused = 0;  // runs finished now; of these, those that failed; runs found finished
  std::vector<LeftOut> left_out;
  bool interrupted = false;
};

// Runs those of `jobs` that have no record yet, each in a process of its own, and keeps their records. A run that
// fails, crashes or hangs becomes a record that says so. Throws InputError before the first run when a sequence is
// missing that has no `get`, or when nothing can run; OutputError when a result cannot be written (full disk): records
// written before are kept. Ends early when `stop` becomes true.
RunnerReport run_jobs(const ResultsFolder& folder, const std::vector<Job>& jobs, const RunnerOptions& options,
                      const std::atomic<bool>& stop);

// Version and checksum of an executable.
std::string program_id(const std::filesystem::path& program);

}  // namespace dkb::bench
