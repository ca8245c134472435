// SPDX-License-Identifier: Apache-2.0
#include "report/charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "dkb/evaluation/svg_drawing.h"

namespace dkb::report {
namespace {

constexpr double kWidth = 480, kLeft = 62, kRight = 14;
constexpr double kPanel = kWidth - kLeft - kRight;
constexpr double kColumns = 400;      // of a chart over time, each with four points at most
constexpr size_t kPathPoints = 3000;  // of a path through space

std::string opening(double height, const std::string& description) {
  return fmt::format("<svg viewBox=\"0 0 {} {:.0f}\" role=\"img\" aria-label=\"{}\">\n", kWidth, height,
                     svg::escaped(description));
}

std::string styled(const char* style) {
  return fmt::format(" class=\"line {}\"", style);
}

// A legend on one line, from the left; names longer than the line run out of it, so they are short.
std::string legend(const std::vector<std::pair<const char*, std::string>>& entries, double y) {
  std::string out;
  double x = kLeft;
  for (const auto& [style, name] : entries) {
    out += fmt::format("<line x1=\"{0:.0f}\" y1=\"{1:.0f}\" x2=\"{2:.0f}\" y2=\"{1:.0f}\"{3} stroke-width=\"3\"/>\n", x,
                       y, x + 18, styled(style));
    out += svg::label(x + 23, y + 4, "start", 11, svg::kInk, name);
    x += 44 + 6.2 * static_cast<double>(name.size());
  }
  return out;
}

std::string bands_svg(const std::vector<Band>& bands, const svg::Panel& panel, double top, double height) {
  std::string out;
  for (const Band& b : bands)
    out += fmt::format("<rect class=\"band {}\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>\n",
                       b.style, panel.px(b.begin), top, std::max(1.5, panel.px(b.end) - panel.px(b.begin)), height);
  return out;
}

// The line with the first, lowest, highest and last value of each column only, and where its stretches start.
struct Thinned {
  std::vector<double> x, y;
  std::vector<size_t> starts;
};
Thinned thinned(const Line& line, double duration) {
  Thinned out;
  const auto column = [&](size_t i) { return std::floor(line.seconds[i] / least_gap(duration)); };
  const auto follows = [&](size_t i) {
    return line.rows[i] == line.rows[i - 1] + 1 || line.seconds[i] - line.seconds[i - 1] < least_gap(duration);
  };
  for (size_t i = 0; i < line.seconds.size();) {
    if (i == 0 || !follows(i)) out.starts.push_back(out.x.size());
    size_t end = i + 1, low = i, high = i;
    for (; end < line.seconds.size() && follows(end) && column(end) == column(i); ++end) {
      if (line.values[end] < line.values[low]) low = end;
      if (line.values[end] > line.values[high]) high = end;
    }
    std::vector<size_t> kept = {i, low, high, end - 1};
    std::sort(kept.begin(), kept.end());
    kept.erase(std::unique(kept.begin(), kept.end()), kept.end());
    for (const size_t k : kept) out.x.push_back(line.seconds[k]), out.y.push_back(line.values[k]);
    i = end;
  }
  return out;
}

std::string line_svg(const Line& line, double duration, const svg::Panel& panel) {
  if (line.seconds.empty()) return "";
  const Thinned t = thinned(line, duration);
  return panel.path(t.x, t.y, t.starts, svg::kInk, 1.5, styled(line.style).c_str());
}

svg::Range range_of(const TimeChart& chart) {
  svg::Range range{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const auto take = [&](double v) { range = {std::min(range.low, v), std::max(range.high, v)}; };
  for (const Line& line : chart.lines) std::for_each(line.values.begin(), line.values.end(), take);
  for (const Level& level : chart.levels) take(level.value);
  if (chart.from_zero) take(0);
  if (range.low > range.high) return {0, 1};
  if (range.length() < 1e-9) range.high += std::max(1e-3, std::abs(range.high));
  if (chart.from_zero) range.high = std::max(range.high, chart.least_top);
  const double air = 0.06 * range.length();
  return {chart.from_zero ? 0 : range.low - air, range.high + air};
}

}  // namespace

double least_gap(double duration) {
  return duration / kColumns;
}

std::string time_chart(const TimeChart& chart, double duration, const std::vector<Band>& bands) {
  constexpr double kTop = 46, kHeight = 150;
  std::string out = opening(kTop + kHeight + 42, chart.title);
  out += svg::label(kLeft, 16, "start", 13, svg::kInk, chart.title, " class=\"title\"");
  std::vector<std::pair<const char*, std::string>> names;
  for (const Line& line : chart.lines) names.emplace_back(line.style, line.name);
  out += legend(names, 32);
  const svg::Panel panel(kLeft, kTop, kPanel, kHeight, {0, duration}, range_of(chart));
  out += bands_svg(bands, panel, kTop, kHeight);
  out += panel.axes("time [s]", chart.unit);
  for (const Line& line : chart.lines) out += line_svg(line, duration, panel);
  for (const Level& level : chart.levels) {
    const double y = panel.py(level.value);
    out += fmt::format("<line class=\"level\" x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\"/>\n", kLeft, y,
                       kLeft + kPanel, y);
    // Below the line where the frame's edge would go through it.
    const double text = y - kTop > 18 ? y - 5 : y + 14;
    out += svg::label(kLeft + kPanel - 4, text, "end", 11, svg::kInk, level.name, " class=\"halo\"");
  }
  return out + "</svg>\n";
}

std::string keyframe_chart(const std::vector<KeyframeTicks>& rules, double duration, const std::vector<Band>& bands) {
  constexpr double kTop = 30, kRow = 40;
  const double height = kRow * static_cast<double>(std::max<size_t>(1, rules.size()));
  std::string out = opening(kTop + height + 42, "Keyframes by rule");
  out += svg::label(kLeft, 16, "start", 13, svg::kInk, "Keyframes by the rule that made them", " class=\"title\"");
  const svg::Panel panel(kLeft, kTop, kPanel, height, {0, duration}, {0, 1});
  out += bands_svg(bands, panel, kTop, height);
  const double step = svg::tick_step(duration);
  for (const double t : svg::ticks({0, duration}, step))
    out += svg::label(panel.px(t), kTop + height + 16, "middle", 11, svg::kInk, svg::tick_text(t, step));
  out += svg::label(kLeft + kPanel / 2, kTop + height + 34, "middle", 12, svg::kInk, "time [s]");
  for (size_t i = 0; i < rules.size(); ++i) {
    const double top = kTop + kRow * static_cast<double>(i);
    std::string path;
    double last = -1e9;
    for (const double s : rules[i].seconds) {
      const double x = panel.px(s);
      if (x - last < 0.1) continue;
      last = x;
      path += fmt::format("M{:.1f} {:.0f}v{:.0f}", x, top + 18, kRow - 22);
    }
    out += fmt::format("<path class=\"tick\" d=\"{}\"/>\n", path);
    out += svg::label(kLeft + 4, top + 13, "start", 11, svg::kInk,
                      fmt::format("{}: {}", rules[i].rule, rules[i].seconds.size()));
    out += fmt::format("<line class=\"grid\" x1=\"{0}\" y1=\"{1:.0f}\" x2=\"{2}\" y2=\"{1:.0f}\"/>\n", kLeft,
                       top + kRow, kLeft + kPanel);
  }
  return out + "</svg>\n";
}

std::string stage_chart(const std::vector<StageRow>& stages, double frame_ms) {
  constexpr double kTop = 48, kRow = 34, kNames = 134;
  const double height = kRow * static_cast<double>(stages.size());
  size_t bins = 0;
  for (const StageRow& s : stages) bins = std::max(bins, s.counts.size());
  const double frame_bin = 4 * (std::log2(frame_ms) + 5);
  const double last = std::max(static_cast<double>(bins), frame_bin + 4);
  const double px = (kWidth - kNames - kRight) / last;
  const auto x_of = [&](double ms) { return kNames + 4 * (std::log2(ms) + 5) * px; };
  std::string out = opening(kTop + height + 42, "Durations by stage");
  out += svg::label(kNames, 16, "start", 13, svg::kInk, "How long each stage took", " class=\"title\"");
  for (double ms = 0.1; x_of(ms) <= kWidth - kRight; ms *= 10) {
    out += fmt::format("<line class=\"grid\" x1=\"{0:.1f}\" y1=\"{1:.0f}\" x2=\"{0:.1f}\" y2=\"{2:.0f}\"/>\n", x_of(ms),
                       kTop, kTop + height);
    out += svg::label(x_of(ms), kTop + height + 16, "middle", 11, svg::kInk, fmt::format("{:g}", ms));
  }
  out += svg::label(kNames + (kWidth - kNames - kRight) / 2, kTop + height + 34, "middle", 12, svg::kInk,
                    "duration [ms], logarithmic");
  for (size_t i = 0; i < stages.size(); ++i) {
    const StageRow& s = stages[i];
    const double bottom = kTop + kRow * static_cast<double>(i + 1) - 4;
    out += svg::label(kNames - 8, bottom - 8, "end", 11, svg::kInk, s.name);
    const double most = s.counts.empty() ? 1 : *std::max_element(s.counts.begin(), s.counts.end());
    std::string path;
    for (size_t k = 0; k < s.counts.size(); ++k)
      if (const double tall = (kRow - 8) * s.counts[k] / most; s.counts[k] > 0)
        path += fmt::format("M{:.1f} {:.1f}v-{:.1f}h{:.1f}v{:.1f}z", kNames + static_cast<double>(k) * px, bottom,
                            std::max(1.0, tall), px, std::max(1.0, tall));
    out += fmt::format("<path class=\"bars\" d=\"{}\"/>\n", path);
    out += fmt::format("<line class=\"grid\" x1=\"{0}\" y1=\"{1:.0f}\" x2=\"{2}\" y2=\"{1:.0f}\"/>\n", kNames, bottom,
                       kWidth - kRight);
  }
  const double x = x_of(frame_ms);
  out += fmt::format("<line class=\"budget\" x1=\"{0:.1f}\" y1=\"{1:.0f}\" x2=\"{0:.1f}\" y2=\"{2:.0f}\"/>\n", x,
                     kTop - 6, kTop + height);
  out += svg::label(kNames, 34, "start", 11, svg::kInk, fmt::format("dashed: the {:.1f} ms of a frame", frame_ms));
  return out + "</svg>\n";
}

UpAxis up_axis(const std::vector<Rigid3>& world_from_cam) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Rigid3& pose : world_from_cam) up -= pose.rotation * Eigen::Vector3d::UnitY();
  Eigen::Index axis = 2;
  up.cwiseAbs().maxCoeff(&axis);
  return {static_cast<int>(axis), up[axis] < 0};
}

namespace {

// Directions of the picture's right and up, and their names.
struct View {
  std::string title;
  Eigen::Vector3d right, up;
  std::string right_name, up_name;  // empty: no axes
};

// Points nearer than `least` to the last one that is kept are left out, but a stretch keeps its ends.
std::string thin_path(const SpacePath& path, const std::vector<Eigen::Vector2d>& px, double least) {
  std::string out;
  for (size_t k = 0; k < path.starts.size(); ++k) {
    const size_t begin = path.starts[k], end = k + 1 < path.starts.size() ? path.starts[k + 1] : px.size();
    Eigen::Vector2d last = px[begin];
    out += fmt::format("M{:.1f} {:.1f}L", last.x(), last.y());
    for (size_t i = begin; i < end; ++i)
      if (i + 1 == end || (px[i] - last).norm() >= least) {
        last = px[i];
        out += fmt::format("{:.1f} {:.1f} ", last.x(), last.y());
      }
  }
  return out;
}

std::string path_svg(const SpacePath& path, const std::vector<Eigen::Vector2d>& px) {
  if (px.empty()) return "";
  double least = 0.7;
  std::string d = thin_path(path, px, least);
  while (d.size() > 11 * kPathPoints && least < 100) d = thin_path(path, px, least *= 2);
  return fmt::format("<path class=\"line {}\" d=\"{}\"/>\n", path.style, d);
}

// `floor`: lines on the ground below, for a view in space.
std::string view_svg(const View& view, const std::vector<SpacePath>& paths, const std::vector<SpacePath>& floor) {
  constexpr double kTop = 46, kHeight = 330;
  const auto project = [&](const Eigen::Vector3d& p) { return Eigen::Vector2d(view.right.dot(p), view.up.dot(p)); };
  svg::Range x{1e300, -1e300}, y{1e300, -1e300};
  for (const auto* all : {&paths, &floor})
    for (const SpacePath& path : *all)
      for (const Eigen::Vector3d& p : path.points) {
        const Eigen::Vector2d q = project(p);
        x = {std::min(x.low, q.x()), std::max(x.high, q.x())};
        y = {std::min(y.low, q.y()), std::max(y.high, q.y())};
      }
  svg::frame_equally(kPanel, kHeight, &x, &y);
  const svg::Panel panel(kLeft, kTop, kPanel, kHeight, x, y);
  std::string out = opening(kTop + kHeight + 42, view.title);
  out += svg::label(kLeft, 16, "start", 13, svg::kInk, view.title, " class=\"title\"");
  std::vector<std::pair<const char*, std::string>> names;
  for (const SpacePath& path : paths) names.emplace_back(path.style, path.name);
  out += legend(names, 32);
  if (!view.up_name.empty()) out += panel.axes(view.right_name, view.up_name);
  for (const auto* all : {&floor, &paths})
    for (const SpacePath& path : *all) {
      std::vector<Eigen::Vector2d> px;
      for (const Eigen::Vector3d& p : path.points) {
        const Eigen::Vector2d q = project(p);
        px.emplace_back(panel.px(q.x()), panel.py(q.y()));
      }
      out += path_svg(path, px);
    }
  const Eigen::Vector2d start = project(paths.back().points.front());
  out += fmt::format("<circle class=\"start\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\"/>\n", panel.px(start.x()),
                     panel.py(start.y()));
  return out + "</svg>\n";
}

// A grid below the paths, and the shadow of the last of them on it.
std::vector<SpacePath> floor_below(const std::vector<SpacePath>& paths, double* step) {
  Eigen::Vector3d low = paths.back().points.front(), high = low;
  for (const SpacePath& path : paths)
    for (const Eigen::Vector3d& p : path.points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  const double side = std::max({(high - low).maxCoeff(), 1e-3});
  *step = svg::tick_step(side);
  const double level = low.z() - 0.15 * side;
  SpacePath grid{"grid", "", {}, {}};
  const Eigen::Array2d first = (low.head<2>() / *step).array().floor() * *step,
                       last = (high.head<2>() / *step).array().ceil() * *step;
  const auto add = [&](double ax, double ay, double bx, double by) {
    grid.starts.push_back(grid.points.size());
    grid.points.emplace_back(ax, ay, level);
    grid.points.emplace_back(bx, by, level);
  };
  for (const double x : svg::ticks({first.x(), last.x()}, *step)) add(x, first.y(), x, last.y());
  for (const double y : svg::ticks({first.y(), last.y()}, *step)) add(first.x(), y, last.x(), y);
  SpacePath shadow = paths.back();
  shadow.style = "shadow";
  for (Eigen::Vector3d& p : shadow.points) p.z() = level;
  return {grid, shadow};
}

}  // namespace

// A right-handed frame with up for either sign.
std::pair<int, int> axes_from_above(UpAxis up) {
  std::pair<int, int> axes((up.axis + 1) % 3, (up.axis + 2) % 3);
  if (up.negative) std::swap(axes.first, axes.second);
  return axes;
}

std::vector<std::string> path_views(const std::vector<SpacePath>& paths, UpAxis up) {
  const auto [a, b] = axes_from_above(up);
  std::vector<SpacePath> local;
  for (SpacePath path : paths) {
    if (path.points.empty()) continue;
    for (Eigen::Vector3d& p : path.points) p = Eigen::Vector3d(p[a], p[b], up.negative ? -p[up.axis] : p[up.axis]);
    local.push_back(std::move(path));
  }
  if (local.empty()) return {};
  const auto name = [](int axis) { return std::string(1, "xyz"[axis]); };
  const std::string up_name = (up.negative ? "-" : "") + name(up.axis) + " [m], up";
  const auto extent = [&](int axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& p : local.back().points) values.push_back(p[axis]);
    return svg::range_of(values).length();
  };
  const bool along_a = extent(0) >= extent(1);
  const Eigen::Vector3d ea = Eigen::Vector3d::UnitX(), eb = Eigen::Vector3d::UnitY(), eu = Eigen::Vector3d::UnitZ();
  constexpr double kTurn = -0.6, kTilt = 0.45;  // [rad]
  const Eigen::Vector3d right = std::cos(kTurn) * ea + std::sin(kTurn) * eb;
  const Eigen::Vector3d away = -std::sin(kTurn) * ea + std::cos(kTurn) * eb;
  double step = 1;
  const std::vector<SpacePath> floor = floor_below(local, &step);
  return {view_svg({"From above", ea, eb, name(a) + " [m]", name(b) + " [m]"}, local, {}),
          view_svg({"From the side", along_a ? ea : eb, eu, name(along_a ? a : b) + " [m]", up_name}, local, {}),
          view_svg({fmt::format("In space, over a grid of {:g} m", step), right,
                    std::cos(kTilt) * eu + std::sin(kTilt) * away, "", ""},
                   local, floor)};
}

namespace {

constexpr double kMapTop = 46, kMapHeight = 330;
constexpr size_t kMapBytes = 60000;  // of the points, or of the cells

// Cells of a raster, row 0 at the top, as a path of horizontal runs; `thick`: filled rectangles, else strokes.
std::string runs(const Image<uint8_t>& cells, uint8_t wanted, bool thick) {
  std::string d;
  for (int y = 0; y < cells.height(); ++y)
    for (int x = 0; x < cells.width(); ++x) {
      if (cells(x, y) != wanted) continue;
      const int begin = x;
      while (x < cells.width() && cells(x, y) == wanted) ++x;
      d += thick ? fmt::format("M{} {}h{}v1h-{}z", begin, y, x - begin, x - begin)
                 : fmt::format("M{} {}h{}", begin, y, x - begin);
    }
  return d;
}

// A bar of a length that is easy to think of, at the lower right.
std::string scale_bar(const svg::Panel& panel, double metres_across) {
  const double step = svg::tick_step(metres_across), px = panel.px(step) - panel.px(0);
  const double right = kLeft + kPanel - 12, y = kMapTop + kMapHeight - 12;
  return fmt::format("<path class=\"scale\" d=\"M{:.1f} {:.1f}v-6v3h{:.1f}v3v-6\"/>\n", right - px, y + 3, px) +
         svg::label(right - px / 2, y - 8, "middle", 11, svg::kInk, fmt::format("{:g} m", step), " class=\"halo\"");
}

std::vector<Eigen::Vector2d> pixels(const svg::Panel& panel, const std::vector<Eigen::Vector3d>& points) {
  std::vector<Eigen::Vector2d> px;
  for (const Eigen::Vector3d& p : points) px.emplace_back(panel.px(p.x()), panel.py(p.y()));
  return px;
}

std::string start_mark(const svg::Panel& panel, const SpacePath& path) {
  if (path.points.empty()) return "";
  return fmt::format("<circle class=\"start\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\"/>\n",
                     panel.px(path.points.front().x()), panel.py(path.points.front().y()));
}

// All but the farthest hundredth at either end, which are mostly wrong.
svg::Range usual_range(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t skipped = values.size() / 100;
  return {values[skipped], values[values.size() - 1 - skipped]};
}

void widen(svg::Range& range, double value) {
  range = {std::min(range.low, value), std::max(range.high, value)};
}

}  // namespace

std::string map_above(const MapAbove& map) {
  std::vector<double> xs, ys;
  for (const auto* all : {&map.points, &map.path.points})
    for (const Eigen::Vector3d& p : *all) xs.push_back(p.x()), ys.push_back(p.y());
  if (xs.empty()) return "";
  svg::Range x = usual_range(std::move(xs)), y = usual_range(std::move(ys));
  for (const auto* all : {&map.keyframes, &map.path.points})
    for (const Eigen::Vector3d& p : *all) widen(x, p.x()), widen(y, p.y());
  svg::frame_equally(kPanel, kMapHeight, &x, &y);
  const svg::Panel panel(kLeft, kMapTop, kPanel, kMapHeight, x, y);
  std::string out = opening(kMapTop + kMapHeight + 42, "The map from above");
  out += svg::label(kLeft, 16, "start", 13, svg::kInk, "The map from above", " class=\"title\"");
  out += legend({{"cloud", "map points"}, {"keys", "keyframes"}, {map.path.style, "path"}}, 32);
  out += panel.axes(map.right_name, map.up_name);
  // Points as cells of a raster: a picture of a large map is no larger than one of a small one.
  std::string cloud;
  for (double cell = 1.2; cell == 1.2 || cloud.size() > kMapBytes; cell *= 1.4) {
    Image<uint8_t> cells(static_cast<int>(kPanel / cell), static_cast<int>(kMapHeight / cell), uint8_t{0});
    for (const Eigen::Vector2d& p : pixels(panel, map.points)) {
      const double column = (p.x() - kLeft) / cell, row = (p.y() - kMapTop) / cell;
      if (column >= 0 && row >= 0 && column < cells.width() && row < cells.height())
        cells(static_cast<int>(column), static_cast<int>(row)) = 1;
    }
    cloud = fmt::format("<path class=\"cloud\" transform=\"translate({} {:.1f}) scale({:.3g})\" d=\"{}\"/>\n", kLeft,
                        kMapTop + cell / 2, cell, runs(cells, 1, false));
  }
  out += cloud + path_svg(map.path, pixels(panel, map.path.points));
  std::string keys;
  Eigen::Vector2d last(-1e9, -1e9);
  for (const Eigen::Vector2d& p : pixels(panel, map.keyframes)) {
    if ((p - last).norm() < 2) continue;
    last = p;
    keys += fmt::format("M{:.1f} {:.1f}h.1", p.x(), p.y());
  }
  out += "<path class=\"keys\" d=\"" + keys + "\"/>\n";
  return out + start_mark(panel, map.path) + scale_bar(panel, x.length()) + "</svg>\n";
}

std::string grid_above(const OccupancyGrid& grid, const SpacePath& path) {
  const Image<uint8_t>& full = grid.cells;
  if (full.width() == 0 || full.height() == 0) return "";
  svg::Range x{grid.origin_x, grid.origin_x + full.width() * grid.cell},
      y{grid.origin_y, grid.origin_y + full.height() * grid.cell};
  const double top = y.high;
  for (const Eigen::Vector3d& p : path.points) widen(x, p.x()), widen(y, p.y());
  svg::frame_equally(kPanel, kMapHeight, &x, &y);
  const svg::Panel panel(kLeft, kMapTop, kPanel, kMapHeight, x, y);
  std::string out = opening(kMapTop + kMapHeight + 42, "Where a robot can drive");
  out += svg::label(kLeft, 16, "start", 13, svg::kInk, "Where a robot can drive", " class=\"title\"");
  out += legend({{"free", "free"}, {"occupied", "occupied"}, {"unknown", "unknown"}, {path.style, "path"}}, 32);
  out += fmt::format("<rect class=\"unknown\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\n", kLeft, kMapTop, kPanel,
                     kMapHeight);
  // Of cells that are drawn as one, an occupied one counts before a free one.
  std::string cells;
  for (int step = 1; cells.empty() || cells.size() > kMapBytes; ++step) {
    Image<uint8_t> joined((full.width() + step - 1) / step, (full.height() + step - 1) / step, OccupancyGrid::kUnknown);
    for (int row = 0; row < full.height(); ++row)
      for (int column = 0; column < full.width(); ++column) {
        const uint8_t value = full(column, row);
        uint8_t& shown = joined(column / step, row / step);
        if (value == OccupancyGrid::kOccupied || (value == OccupancyGrid::kFree && shown == OccupancyGrid::kUnknown))
          shown = value;
      }
    cells = fmt::format("<g transform=\"translate({:.2f} {:.2f}) scale({:.5g})\" shape-rendering=\"crispEdges\">",
                        panel.px(grid.origin_x), panel.py(top), (panel.px(grid.cell) - panel.px(0)) * step);
    for (const auto& [style, value] :
         {std::pair{"free", OccupancyGrid::kFree}, std::pair{"occupied", OccupancyGrid::kOccupied}})
      cells += fmt::format("<path class=\"{}\" d=\"{}\"/>\n", style, runs(joined, value, true));
    cells += "</g>\n";
  }
  out += cells + panel.axes("x of the grid [m]", "y of the grid [m]");
  return out + path_svg(path, pixels(panel, path.points)) + start_mark(panel, path) + scale_bar(panel, x.length()) +
         "</svg>\n";
}

}  // namespace dkb::report
