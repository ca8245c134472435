// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

#include "bench/bench_report.h"

namespace dkb::bench {

// SVG pictures by file name: ape.svg (APE of every sequence with intervals), sweep.svg, and for every sequence
// SEQUENCE-bars.svg (rmse, mean, median, std, min, max of the APE) and SEQUENCE-paths.svg. The variants are those that
// the suite names as `plotted`, else all.
std::map<std::string, std::string> make_plots(const ResultsFolder& folder, const Results& results);

}  // namespace dkb::bench
