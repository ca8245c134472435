// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dkb/evaluation/trajectory_error.h"

namespace dkb {

// Pictures that compare several systems on one sequence or more, each an SVG file of its own. Systems have the same
// colour wherever they have the same place in the list: blue, orange, green, red, as in figures 5-8 of the DKB paper.

struct Bar {
  double value = 0;
  std::optional<std::pair<double, double>> whisker;  // e.g. a confidence interval
};
struct BarGroup {
  std::string name;
  std::vector<std::optional<Bar>> bars;  // one per system; nothing = not measured
};
struct BarPanel {
  std::string title;
  std::vector<BarGroup> groups;
};
// Panels two by two, each with a scale of its own from 0; a single one takes the whole width. Values that are not
// finite are drawn as not measured.
std::string bar_panels_svg(const std::string& title, const std::string& unit, const std::vector<std::string>& systems,
                           const std::vector<BarPanel>& panels);

struct ComparedPath {
  std::string name;       // of the system
  size_t place = 0;       // its place in the list of systems, which gives the colour
  Evaluation evaluation;  // its estimate is drawn as aligned to the truth
};
// The true path in dashed grey and the estimates, in their two widest projections; nothing between gaps.
std::string compared_paths_svg(const std::string& title, const Trajectory& truth,
                               const std::vector<ComparedPath>& paths);

}  // namespace dkb
