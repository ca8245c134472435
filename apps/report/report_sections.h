// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "report/charts.h"
#include "report/run_report.h"

namespace dkb::report {

// What the sections of a report have in common.
struct Context {
  Context(const RunLog& run_log, const ReportFacts& run_facts, const Truth& run_truth);

  const RunLog& log;
  const ReportFacts& facts;
  const Truth& truth;
  std::vector<double> seconds;  // by row, since the first
  double duration = 1;          // [s] to the last row, above 0
  double fps = 30;
  std::vector<LostStretch> stretches;
  std::vector<Band> bands;
  std::vector<double> error_m;                // by row; NaN where there is no pose or no truth
  double seconds_of(double timestamp) const;  // since the first row
  size_t row_of(double timestamp) const;      // the row of that stamp, to 10 us
};

// The text that stands first: what a reader in a hurry needs, and links to those of the sections that there are.
std::string verdict(const Context& c, const std::string& sections);
std::string path_section(const Context& c);
std::string map_section(const Context& c);
std::string time_section(const Context& c);
std::string lost_section(const Context& c);
std::string tracking_section(const Context& c);
std::string stages_section(const Context& c);
std::string pictures_section(const Context& c);
std::string events_section(const Context& c);
std::string settings_section(const Context& c);

// A number without more digits than it deserves: 0.0123 m, 1.23 m, 12.3 m.
std::string metres(double value);
std::string when(const Context& c, size_t row);  // "frame 12, 0.40 s"

}  // namespace dkb::report
