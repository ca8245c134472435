// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "eval/evaluation_report.h"
#include "svg_drawing.h"

namespace dkb {
namespace {

constexpr const char* kTruth = "#b8bdc6";
constexpr const char* kEstimate = "#1f6feb";
constexpr const char* kError = "#d1495b";

}  // namespace

std::string evaluation_svg(const Evaluation& e, const PlotNames& names) {
  constexpr double kWidth = 960, kHeight = 800;
  std::array<std::vector<double>, 3> truth, estimate;  // by axis
  std::array<svg::Range, 3> range;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<size_t>(axis);
    for (const Rigid3& pose : e.truth) truth[a].push_back(pose.translation[axis]);
    for (const Rigid3& pose : e.estimate) estimate[a].push_back(pose.translation[axis]);
    const svg::Range t = svg::range_of(truth[a]), x = svg::range_of(estimate[a]);
    range[a] = {std::min(t.low, x.low), std::max(t.high, x.high)};
  }
  // The axis of the widest extent against each of the other two.
  std::array<size_t, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return range[a].length() > range[b].length(); });

  std::string out = svg::opening(kWidth, kHeight);
  out += svg::label(70, 34, "start", 18, svg::kInk, names.title, " font-weight=\"bold\"");
  out += svg::label(70, 56, "start", 13, svg::kInk,
                    fmt::format("APE {:.4f} m, {:.3f} deg rmse; RPE ({}) {:.4f} m, {:.3f} deg rmse; {} poses",
                                e.ape.translation.rmse, e.ape.rotation.rmse, to_string(e.options.rpe_delta),
                                e.rpe.translation.rmse, e.rpe.rotation.rmse, e.timestamps.size()));
  double legend = 70;
  for (const auto& [colour, name] : {std::pair{kTruth, names.truth}, std::pair{kEstimate, names.estimate}}) {
    out += fmt::format("<line x1=\"{:.1f}\" y1=\"76\" x2=\"{:.1f}\" y2=\"76\" stroke=\"{}\" stroke-width=\"3\"/>\n",
                       legend, legend + 26, colour);
    out += svg::label(legend + 32, 80, "start", 12, svg::kInk, name);
    legend += 60 + 7.0 * static_cast<double>(name.size());
  }
  out += fmt::format("<circle cx=\"{:.1f}\" cy=\"76\" r=\"4\" fill=\"{}\"/>\n", legend + 4, kEstimate);
  out += svg::label(legend + 14, 80, "start", 12, svg::kInk, "start");

  const std::vector<size_t> starts = svg::stretches(e.timestamps);
  static constexpr const char* kAxisName[] = {"x [m]", "y [m]", "z [m]"};
  for (size_t panel = 0; panel < 2; ++panel) {
    const size_t h = order[0], v = order[panel + 1];
    svg::Range x = range[h], y = range[v];
    constexpr double kSide = 385, kTall = 340;
    svg::frame_equally(kSide, kTall, &x, &y);
    const svg::Panel p(70 + 470 * static_cast<double>(panel), 96, kSide, kTall, x, y);
    out += p.axes(kAxisName[h], kAxisName[v]);
    out += p.path(truth[h], truth[v], starts, kTruth, 5);
    out += p.path(estimate[h], estimate[v], starts, kEstimate, 1.5);
    out += p.dot(estimate[h].front(), estimate[v].front(), kEstimate);
  }

  std::vector<double> seconds;
  for (const double t : e.timestamps) seconds.push_back(t - e.timestamps.front());
  const double duration = std::max(svg::range_of(seconds).high, 1e-3), most = std::max(e.ape.translation.max, 1e-9);
  const svg::Panel errors(70, 510, 855, 230, {0, duration}, {0, 1.1 * most});
  out += errors.axes("time since the first matched pose [s]", "APE [m]");
  out += errors.path(seconds, e.ape.translation_m, starts, kError, 1.2);
  out += errors.level(e.ape.translation.rmse, fmt::format("dashed: rmse {:.4f} m", e.ape.translation.rmse));
  return out + "</svg>\n";
}

}  // namespace dkb
