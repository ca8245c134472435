// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "dkb/evaluation/svg_drawing.h"

namespace dkb {
namespace {

constexpr const char* kTruth = "#8b949e";
constexpr const char* kColours[] = {"#1f6feb", "#f0883e", "#2da44e", "#d1242f", "#8250df",
                                    "#9a6700", "#bf3989", "#1b7c83", "#57606a", "#b5a800"};
const char* colour_of(size_t system) {
  return kColours[system % std::size(kColours)];
}

// One line of squares and names; wraps at `width`. Returns the height taken.
double draw_legend(const std::vector<std::pair<const char*, std::string>>& entries, double left, double top,
                   double width, std::string* out) {
  double x = left, y = top;
  for (const auto& [colour, name] : entries) {
    const double wide = 34 + 7.0 * static_cast<double>(name.size());
    if (x > left && x + wide > left + width) x = left, y += 20;
    *out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"12\" height=\"12\" fill=\"{}\"/>\n", x, y, colour);
    *out += svg::label(x + 18, y + 11, "start", 12, svg::kInk, name);
    x += wide;
  }
  return y - top + 20;
}

bool drawable(const std::optional<Bar>& bar) {
  return bar && std::isfinite(bar->value) && bar->value >= 0;
}

double highest(const BarPanel& panel) {
  double most = 0;
  for (const BarGroup& group : panel.groups)
    for (const auto& bar : group.bars)
      if (drawable(bar)) {
        most = std::max(most, bar->value);
        if (bar->whisker && std::isfinite(bar->whisker->second)) most = std::max(most, bar->whisker->second);
      }
  return most > 0 ? most : 1;
}

void draw_bar(const svg::Panel& panel, double left, double width, const Bar& bar, const char* colour,
              std::string* out) {
  const double top = panel.py(bar.value), bottom = panel.py(0);
  *out += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", left, top,
                      width, bottom - top, colour);
  if (!bar.whisker || !std::isfinite(bar.whisker->first) || !std::isfinite(bar.whisker->second)) return;
  const double middle = left + width / 2, low = panel.py(bar.whisker->first), high = panel.py(bar.whisker->second),
               half = std::min(4.0, width / 3);
  *out += fmt::format(
      "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}M{3:.1f} {1:.1f}H{4:.1f}M{3:.1f} {2:.1f}H{4:.1f}\" stroke=\"{5}\" "
      "fill=\"none\"/>\n",
      middle, low, high, middle - half, middle + half, svg::kInk);
}

void draw_panel(const BarPanel& chart, size_t systems, const std::string& unit, double left, double top, double width,
                double height, std::string* out) {
  const svg::Panel panel(left, top, width, height, {0, 1}, {0, 1.08 * highest(chart)});
  *out += svg::label(left, top - 8, "start", 13, svg::kInk, chart.title, " font-weight=\"bold\"");
  *out += panel.y_axis(unit);
  const double group_width = width / static_cast<double>(std::max<size_t>(1, chart.groups.size()));
  const double bar_width = std::min(46.0, 0.84 * group_width / static_cast<double>(std::max<size_t>(1, systems)));
  for (size_t g = 0; g < chart.groups.size(); ++g) {
    const BarGroup& group = chart.groups[g];
    const double middle = left + (static_cast<double>(g) + 0.5) * group_width;
    const double first = middle - 0.5 * bar_width * static_cast<double>(systems);
    for (size_t s = 0; s < systems && s < group.bars.size(); ++s)
      if (drawable(group.bars[s]))
        draw_bar(panel, first + bar_width * (static_cast<double>(s) + 0.06), 0.88 * bar_width, *group.bars[s],
                 colour_of(s), out);
    *out += svg::label(middle, top + height + 16, "middle", 11, svg::kInk, group.name);
  }
}

}  // namespace

std::string bar_panels_svg(const std::string& title, const std::string& unit, const std::vector<std::string>& systems,
                           const std::vector<BarPanel>& panels) {
  constexpr double kWidth = 960, kWhole = 855, kSide = 385, kTall = 190, kStep = 268;
  std::vector<std::pair<const char*, std::string>> legend;
  for (size_t s = 0; s < systems.size(); ++s) legend.emplace_back(colour_of(s), systems[s]);
  std::string body = svg::label(70, 34, "start", 18, svg::kInk, title, " font-weight=\"bold\"");
  const double top = 52 + draw_legend(legend, 70, 50, kWhole, &body) + 30;
  const double side = panels.size() == 1 ? kWhole : kSide;
  for (size_t p = 0; p < panels.size(); ++p)
    draw_panel(panels[p], systems.size(), unit, 70 + 470 * static_cast<double>(p % 2),
               top + kStep * static_cast<double>(p / 2), side, kTall, &body);
  const double rows = static_cast<double>((panels.size() + 1) / 2);
  return svg::opening(kWidth, top + kStep * rows - 20) + body + "</svg>\n";
}

std::string compared_paths_svg(const std::string& title, const Trajectory& truth,
                               const std::vector<ComparedPath>& paths) {
  constexpr double kWidth = 960, kTall = 360;
  std::vector<std::pair<const char*, std::string>> legend = {{kTruth, "ground truth (dashed)"}};
  for (const ComparedPath& path : paths) legend.emplace_back(colour_of(path.place), path.name);
  std::string body = svg::label(70, 34, "start", 18, svg::kInk, title, " font-weight=\"bold\"");
  const double top = 52 + draw_legend(legend, 70, 50, 855, &body) + 10;

  // Of the truth, only the stretch that the estimates cover.
  double from = 0, until = -1;
  for (const ComparedPath& path : paths)
    if (!path.evaluation.timestamps.empty()) {
      const double first = path.evaluation.timestamps.front(), last = path.evaluation.timestamps.back();
      from = until < from ? first : std::min(from, first);
      until = std::max(until, last);
    }
  struct Curve {
    std::array<std::vector<double>, 3> axis;
    std::vector<size_t> starts;
  };
  const auto curve_of = [](const std::vector<double>& stamps, const std::vector<Rigid3>& poses) {
    Curve curve;
    for (const Rigid3& pose : poses)
      for (size_t a = 0; a < 3; ++a) curve.axis[a].push_back(pose.translation[static_cast<int>(a)]);
    curve.starts = svg::stretches(stamps);
    return curve;
  };
  std::vector<double> stamps;
  std::vector<Rigid3> poses;
  for (const StampedPose& pose : truth)
    if (pose.timestamp >= from - 0.05 && pose.timestamp <= until + 0.05)
      stamps.push_back(pose.timestamp), poses.push_back(pose.world_from_cam);
  std::vector<Curve> curves;
  if (!poses.empty()) curves.push_back(curve_of(stamps, poses));
  const size_t true_curves = curves.size();
  for (const ComparedPath& path : paths)
    curves.push_back(curve_of(path.evaluation.timestamps, path.evaluation.estimate));

  std::array<svg::Range, 3> range;
  for (size_t a = 0; a < 3; ++a) {
    std::vector<double> ends;
    for (const Curve& curve : curves)
      if (!curve.axis[a].empty()) {
        const svg::Range r = svg::range_of(curve.axis[a]);
        ends.insert(ends.end(), {r.low, r.high});
      }
    range[a] = ends.empty() ? svg::Range{0, 1} : svg::range_of(ends);
  }
  for (const svg::Projection& p : svg::widest_projections(range, top, kTall)) {
    body += p.axes();
    for (size_t c = 0; c < curves.size(); ++c) {
      if (curves[c].axis[p.across].empty()) continue;
      const bool is_truth = c < true_curves;
      body += p.panel.path(curves[c].axis[p.across], curves[c].axis[p.up], curves[c].starts,
                           is_truth ? kTruth : colour_of(paths[c - true_curves].place), is_truth ? 2.2 : 1.4,
                           is_truth ? " stroke-dasharray=\"6 4\"" : "");
    }
  }
  return svg::opening(kWidth, top + kTall + 50) + body + "</svg>\n";
}

}  // namespace dkb
