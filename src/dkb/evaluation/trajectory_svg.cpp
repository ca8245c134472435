// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "dkb/evaluation/evaluation_report.h"
#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr const char* kTruth = "#b8bdc6";
constexpr const char* kEstimate = "#1f6feb";
constexpr const char* kError = "#d1495b";
constexpr double kWidth = 960;

// A path to be drawn.
struct Path {
  std::array<std::vector<double>, 3> along;  // [m] by axis
  const char* colour;
  double width;  // [px]
};

Path path_of(const std::vector<Rigid3>& poses, const char* colour, double width) {
  Path path{{}, colour, width};
  for (size_t axis = 0; axis < 3; ++axis)
    for (const Rigid3& pose : poses) path.along[axis].push_back(pose.translation[static_cast<Eigen::Index>(axis)]);
  return path;
}

// The paths in their two widest projections: the axis of the widest extent against each of the other two. The last
// path's start is marked.
std::string projections(const std::vector<Path>& paths, const std::vector<size_t>& starts, double top) {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  std::array<svg::Range, 3> range;
  for (size_t axis = 0; axis < 3; ++axis) {
    range[axis] = {kFar, -kFar};
    for (const Path& path : paths) {
      const svg::Range r = svg::range_of(path.along[axis]);
      range[axis] = {std::min(range[axis].low, r.low), std::max(range[axis].high, r.high)};
    }
  }
  std::string out;
  for (const svg::Projection& p : svg::widest_projections(range, top, 340)) {
    out += p.axes();
    for (const Path& path : paths)
      out += p.panel.path(path.along[p.across], path.along[p.up], starts, path.colour, path.width);
    const Path& last = paths.back();
    out += p.panel.dot(last.along[p.across].front(), last.along[p.up].front(), last.colour);
  }
  return out;
}

std::string heading(const std::string& title, const std::string& line) {
  return svg::label(70, 34, "start", 18, svg::kInk, title, " font-weight=\"bold\"") +
         svg::label(70, 56, "start", 13, svg::kInk, line);
}

}  // namespace

std::string evaluation_svg(const Evaluation& e, const std::string& title) {
  std::string out = svg::opening(kWidth, 800);
  const std::string rpe = e.rpe.translation.count == 0
                              ? "no pair of poses is that far apart"
                              : fmt::format("{:.4f} m, {:.3f} deg rmse", e.rpe.translation.rmse, e.rpe.rotation.rmse);
  const std::string turned =
      e.rotation_determined() ? fmt::format("{:.3f} deg rmse", e.ape.rotation.rmse) : "rotation not determined";
  out += heading(title, fmt::format("APE {:.4f} m, {}; RPE ({}) {}; {} poses", e.ape.translation.rmse, turned,
                                    to_string(e.options.rpe_delta), rpe, e.timestamps.size()));
  double legend = 70;
  for (const auto& [colour, name] :
       {std::pair{kTruth, std::string("ground truth")}, std::pair{kEstimate, std::string("estimate")}}) {
    out += fmt::format("<line x1=\"{:.1f}\" y1=\"76\" x2=\"{:.1f}\" y2=\"76\" stroke=\"{}\" stroke-width=\"3\"/>\n",
                       legend, legend + 26, colour);
    out += svg::label(legend + 32, 80, "start", 12, svg::kInk, name);
    legend += 60 + 7.0 * static_cast<double>(name.size());
  }
  out += fmt::format("<circle cx=\"{:.1f}\" cy=\"76\" r=\"4\" fill=\"{}\"/>\n", legend + 4, kEstimate);
  out += svg::label(legend + 14, 80, "start", 12, svg::kInk, "start");

  const std::vector<size_t> starts = svg::stretches(e.timestamps);
  out += projections({path_of(e.truth, kTruth, 5), path_of(e.estimate, kEstimate, 1.5)}, starts, 96);

  std::vector<double> seconds;
  for (const double t : e.timestamps) seconds.push_back(t - e.timestamps.front());
  const double duration = std::max(svg::range_of(seconds).high, 1e-3), most = std::max(e.ape.translation.max, 1e-9);
  const svg::Panel errors(70, 510, 855, 230, {0, duration}, {0, 1.1 * most});
  out += errors.axes("time since the first matched pose [s]", "APE [m]");
  out += errors.path(seconds, e.ape.translation_m, starts, kError, 1.2);
  out += errors.level(e.ape.translation.rmse, fmt::format("dashed: rmse {:.4f} m", e.ape.translation.rmse));
  return out + "</svg>\n";
}

std::string trajectory_svg(const Trajectory& trajectory, const std::string& title) {
  if (trajectory.empty()) throw InputError("trajectory: it has no pose that could be drawn");
  std::vector<double> stamps;
  std::vector<Rigid3> poses;
  double length = 0;
  for (const StampedPose& pose : trajectory) {
    if (!poses.empty()) length += (pose.world_from_cam.translation - poses.back().translation).norm();
    stamps.push_back(pose.timestamp);
    poses.push_back(pose.world_from_cam);
  }
  std::string out = svg::opening(kWidth, 490);
  out += heading(title, fmt::format("{} poses, {:.2f} m in {:.1f} s; the dot is the start", poses.size(), length,
                                    stamps.back() - stamps.front()));
  out += projections({path_of(poses, kEstimate, 1.5)}, svg::stretches(stamps), 76);
  return out + "</svg>\n";
}

}  // namespace dkb
