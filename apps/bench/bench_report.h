// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "bench/bench_results.h"
#include "bench/run_statistics.h"

namespace dkb::bench {

// All runs of one variant on one sequence.
struct Cell {
  size_t sequence = 0, variant = 0;
  std::vector<RunRecord> finished, failed;  // by seed
  int not_run = 0;
  std::optional<double> published;  // [m]

  bool any_run() const { return !finished.empty() || !failed.empty(); }
  // One figure of every finished run that has it, by seed.
  template <class Get>
  std::vector<double> values(const Get& get) const {
    std::vector<double> all;
    for (const RunRecord& r : finished)
      if (const std::optional<double> value = get(r)) all.push_back(*value);
    return all;
  }
  // The same of an error, of the runs where it was measured.
  std::vector<double> figures(std::optional<Scores> RunRecord::*kind, ErrorStatistics Scores::*part,
                              double ErrorStatistics::*figure) const;
  std::vector<double> ape() const;  // [m] translation rmse
  double scored() const;            // median share of the pairs offered that the APE is of; 0 without any
};

// Frames that one of two lost are its hardest. At three times the RMSE, a twentieth of the frames would raise it by
// sqrt(0.95 + 0.05 * 9) - 1 = 18%, which is as much as ratios are asked to tell.
constexpr double kEven = 0.95;

// A variant against the suite's reference, over the sequences on which both have the same runs.
struct Comparison {
  std::string variant;
  int sequences = 0;
  int left_out = 0;                        // runs on them that failed or that the reference has no partner for
  MedianInterval ratio;                    // geometric mean over sequences of the ratio of median APEs
  std::vector<std::string> better, worse;  // sequences where the interval of the ratio leaves out 1
  // Sequences where one scored less than kEven of the frames of the other, with both shares.
  struct Uneven {
    std::string sequence;
    double ours = 0, reference = 0;
  };
  std::vector<Uneven> uneven;
  bool is_uneven(const std::string& sequence) const;
};

// What the sweep says of one sequence.
struct SweepResult {
  std::string sequence;
  size_t runs = 0;                       // seeds with all values
  std::vector<MedianInterval> ape;       // [m] by value of the sweep
  size_t best = 0;                       // its index
  double spread = 0;                     // [m] largest less smallest median
  double noise = 0;                      // [m] median width of the intervals
  double p_value = 1;                    // Friedman's test over seeds
  bool exceeds_noise = false;            // p below 5% divided by the number of sequences (Bonferroni)
  std::optional<MedianInterval> choice;  // ratio of the published choice's APE to the best one's
};

struct Results {
  const Suite* suite = nullptr;
  std::vector<Cell> cells;  // sequences x variants
  std::vector<Comparison> comparisons;
  std::vector<SweepResult> sweep;
  std::vector<std::string> chosen_sequences, chosen_variants;  // none = all
  // Whether a report has a row, a column and a bar for it: what nobody asked for is not missing.
  bool shows(size_t variant) const;
};
// Statistics of `records`, which must be of the suite's runs.
Results results_of(const Suite& suite, const std::vector<RunRecord>& records);

// Honest sentences on the sweep, computed from it; empty without one.
std::vector<std::string> sweep_sentences(const Results& results);

struct ReportOptions {
  bool times = true;  // false: only what does not depend on the machine, so that reports can be compared byte by byte
};
struct Report {
  std::string markdown, html, json;
  std::map<std::string, std::string> plots;  // SVG by file name
};
// results.json.
std::string results_json(const Results& results, const ReportOptions& options);
// `folder` gives the trajectories for the plots.
Report make_report(const ResultsFolder& folder, const ReportOptions& options);

// results.md, report.html, results.json and plots/*.svg. Throws OutputError.
void write_report(const std::filesystem::path& folder, const Report& report);

}  // namespace dkb::bench
