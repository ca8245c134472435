// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <utility>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb_slam/map.h"

// The report's diagrams: SVG inside HTML, coloured by the page's classes so that they follow its light and dark. Their
// size does not grow with the number of frames.
namespace dkb::report {

// [s] Gaps below are too short to be seen in a chart of that duration.
double least_gap(double duration);

// A line over time. Where `row`s do not follow on one another nothing is drawn between them.
struct Line {
  const char* style = "";  // class of the page
  std::string name;
  std::vector<double> seconds, values;
  std::vector<size_t> rows;

  void add(double second, double value, size_t row) {
    seconds.push_back(second);
    values.push_back(value);
    rows.push_back(row);
  }
};

// A stretch of time that is shaded in every chart.
struct Band {
  double begin = 0, end = 0;  // [s]
  const char* style = "";
};

struct Level {
  double value = 0;
  std::string name;
};

struct TimeChart {
  std::string title, unit;
  std::vector<Line> lines;
  bool from_zero = false;
  std::vector<Level> levels = {};  // dashed lines across
  double least_top = 0;            // from zero at least to here, so that next to nothing looks like it
};
// `duration` [s]: of all charts of a page.
std::string time_chart(const TimeChart& chart, double duration, const std::vector<Band>& bands);

// A row of ticks for each rule that made keyframes.
struct KeyframeTicks {
  std::string rule;
  std::vector<double> seconds;
};
std::string keyframe_chart(const std::vector<KeyframeTicks>& rules, double duration, const std::vector<Band>& bands);

// Durations of stages, one below the other on one logarithmic scale, and the time that a frame has.
struct StageRow {
  std::string name;
  std::vector<int> counts;  // as Statistics::stage_histograms
};
std::string stage_chart(const std::vector<StageRow>& stages, double frame_ms);

// A path through space; `starts`: where a stretch without gaps begins.
struct SpacePath {
  const char* style = "";
  std::string name;
  std::vector<Eigen::Vector3d> points;
  std::vector<size_t> starts = {0};
};
// Which of the world's axes points up, by cameras that are mostly held upright: 0 ... 2, and its sign.
struct UpAxis {
  int axis = 2;
  bool negative = false;
};
UpAxis up_axis(const std::vector<Rigid3>& world_from_cam);
// The world's axes that point to the right and up in a picture from above.
std::pair<int, int> axes_from_above(UpAxis up);
// From above, from the side and in space. The last path's start is marked.
std::vector<std::string> path_views(const std::vector<SpacePath>& paths, UpAxis up);

// A map from above [m], its path last; of points far from all others some may lie outside the picture.
struct MapAbove {
  std::string right_name, up_name;
  std::vector<Eigen::Vector3d> points, keyframes;  // x to the right, y up in the picture
  SpacePath path;                                  // likewise
};
std::string map_above(const MapAbove& map);
// `path`: on the grid's floor.
std::string grid_above(const OccupancyGrid& grid, const SpacePath& path);

}  // namespace dkb::report
