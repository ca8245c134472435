// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "dkb/evaluation/evaluation_report.h"

namespace dkb {
namespace {

constexpr const char* kTruth = "#b8bdc6";
constexpr const char* kEstimate = "#1f6feb";
constexpr const char* kError = "#d1495b";
constexpr const char* kInk = "#24292f";
constexpr const char* kGrid = "#e6e8eb";

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '&')
      out += "&amp;";
    else if (c == '<')
      out += "&lt;";
    else if (c == '>')
      out += "&gt;";
    else if (c == '"')
      out += "&quot;";
    else if (static_cast<unsigned char>(c) >= 0x20)
      out += c;
  }
  return out;
}

struct Range {
  double low = 0, high = 0;
  double length() const { return high - low; }
  double middle() const { return 0.5 * (low + high); }
};

Range range_of(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {*low, *high};
}

// The largest of 1, 2 and 5 times a power of ten that cuts `length` into at least three pieces.
double tick_step(double length) {
  const double raw = length / 3.0;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power <= raw * (1 + 1e-9)) return factor * power;
  return power;
}

int decimals_of(double step) {
  return std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
}

std::string label(double x, double y, const char* anchor, int size, const char* colour, const std::string& text,
                  const char* extra = "") {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\" fill=\"{}\"{}>{}</text>\n", x,
                     y, anchor, size, colour, extra, escaped(text));
}

// One diagram: maps values to the rectangle and draws grid, axes and lines.
class Panel {
 public:
  Panel(double left, double top, double width, double height, Range x, Range y)
      : left_(left), top_(top), width_(width), height_(height), x_(x), y_(y) {}

  std::string axes(const std::string& x_name, const std::string& y_name) const {
    std::string out;
    const double x_step = tick_step(x_.length()), y_step = tick_step(y_.length());
    for (double k = std::ceil(x_.low / x_step - 1e-9); k * x_step <= x_.high + 1e-9 * x_step; ++k) {
      const double at = px(k * x_step);
      out += line(at, top_, at, top_ + height_);
      out += label(at, top_ + height_ + 16, "middle", 11, kInk, number(k * x_step, x_step));
    }
    for (double k = std::ceil(y_.low / y_step - 1e-9); k * y_step <= y_.high + 1e-9 * y_step; ++k) {
      const double at = py(k * y_step);
      out += line(left_, at, left_ + width_, at);
      out += label(left_ - 6, at + 4, "end", 11, kInk, number(k * y_step, y_step));
    }
    out += fmt::format(
        "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"{}\"/>\n", left_,
        top_, width_, height_, kInk);
    out += label(left_ + width_ / 2, top_ + height_ + 34, "middle", 12, kInk, x_name);
    const double x = left_ - 52, y = top_ + height_ / 2;
    out +=
        label(x, y, "middle", 12, kInk, y_name, fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", x, y).c_str());
    return out;
  }

  // `starts`: where a new stretch begins; between stretches nothing is drawn.
  std::string path(const std::vector<double>& x, const std::vector<double>& y, const std::vector<size_t>& starts,
                   const char* colour, double width) const {
    std::string out;
    for (size_t k = 0; k < starts.size(); ++k) {
      const size_t end = k + 1 < starts.size() ? starts[k + 1] : x.size();
      std::string points;
      for (size_t i = starts[k]; i < end; ++i) points += fmt::format("{:.1f},{:.1f} ", px(x[i]), py(y[i]));
      points.pop_back();
      out += fmt::format(
          "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\" "
          "stroke-linecap=\"round\"/>\n",
          points, colour, width);
    }
    return out;
  }

  std::string dot(double x, double y, const char* colour) const {
    return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", px(x), py(y), colour);
  }

  std::string level(double y, const std::string& text) const {
    return fmt::format(
               "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-dasharray=\"5 "
               "4\"/>\n",
               left_, py(y), left_ + width_, py(y), kInk) +
           label(left_ + width_, top_ - 6, "end", 12, kInk, text);
  }

 private:
  double px(double x) const { return left_ + (x - x_.low) / x_.length() * width_; }
  double py(double y) const { return top_ + height_ - (y - y_.low) / y_.length() * height_; }
  static std::string line(double x1, double y1, double x2, double y2) {
    return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x1, y1, x2,
                       y2, kGrid);
  }
  static std::string number(double value, double step) {
    return fmt::format("{:.{}f}", std::abs(value) < 1e-9 * step ? 0.0 : value, decimals_of(step));
  }

  double left_, top_, width_, height_;
  Range x_, y_;
};

// Indices at which a stretch without gaps begins; a gap is ten usual steps between stamps.
std::vector<size_t> stretches(const std::vector<double>& timestamps) {
  std::vector<double> steps;
  for (size_t i = 1; i < timestamps.size(); ++i) steps.push_back(timestamps[i] - timestamps[i - 1]);
  std::vector<double> sorted = steps;
  std::sort(sorted.begin(), sorted.end());
  std::vector<size_t> starts{0};
  for (size_t i = 0; i < steps.size(); ++i)
    if (const double usual = sorted[sorted.size() / 2]; usual > 0 && steps[i] > 10.0 * usual) starts.push_back(i + 1);
  return starts;
}

// Ranges around two sets of coordinates with one scale for both axes of a panel, so that shapes are true.
void frame_equally(double width, double height, Range* x, Range* y) {
  double metres_per_px = 1.12 * std::max(x->length() / width, y->length() / height);
  if (metres_per_px < 1e-12) metres_per_px = 1.0 / width;
  *x = {x->middle() - 0.5 * metres_per_px * width, x->middle() + 0.5 * metres_per_px * width};
  *y = {y->middle() - 0.5 * metres_per_px * height, y->middle() + 0.5 * metres_per_px * height};
}

}  // namespace

std::string evaluation_svg(const Evaluation& e, const PlotNames& names) {
  constexpr double kWidth = 960, kHeight = 800;
  std::array<std::vector<double>, 3> truth, estimate;  // by axis
  std::array<Range, 3> range;
  for (int axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<size_t>(axis);
    for (const Rigid3& pose : e.truth) truth[a].push_back(pose.translation[axis]);
    for (const Rigid3& pose : e.estimate) estimate[a].push_back(pose.translation[axis]);
    const Range t = range_of(truth[a]), x = range_of(estimate[a]);
    range[a] = {std::min(t.low, x.low), std::max(t.high, x.high)};
  }
  // The axis of the widest extent against each of the other two.
  std::array<size_t, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return range[a].length() > range[b].length(); });

  std::string out = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"Helvetica, Arial, sans-serif\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
      kWidth, kHeight);
  out += label(70, 34, "start", 18, kInk, names.title, " font-weight=\"bold\"");
  out += label(70, 56, "start", 13, kInk,
               fmt::format("APE {:.4f} m, {:.3f} deg rmse; RPE ({}) {:.4f} m, {:.3f} deg rmse; {} poses",
                           e.ape.translation.rmse, e.ape.rotation.rmse, to_string(e.options.rpe_delta),
                           e.rpe.translation.rmse, e.rpe.rotation.rmse, e.timestamps.size()));
  double legend = 70;
  for (const auto& [colour, name] : {std::pair{kTruth, names.truth}, std::pair{kEstimate, names.estimate}}) {
    out += fmt::format("<line x1=\"{:.1f}\" y1=\"76\" x2=\"{:.1f}\" y2=\"76\" stroke=\"{}\" stroke-width=\"3\"/>\n",
                       legend, legend + 26, colour);
    out += label(legend + 32, 80, "start", 12, kInk, name);
    legend += 60 + 7.0 * static_cast<double>(name.size());
  }
  out += fmt::format("<circle cx=\"{:.1f}\" cy=\"76\" r=\"4\" fill=\"{}\"/>\n", legend + 4, kEstimate);
  out += label(legend + 14, 80, "start", 12, kInk, "start");

  const std::vector<size_t> starts = stretches(e.timestamps);
  static constexpr const char* kAxisName[] = {"x [m]", "y [m]", "z [m]"};
  for (size_t panel = 0; panel < 2; ++panel) {
    const size_t h = order[0], v = order[panel + 1];
    Range x = range[h], y = range[v];
    constexpr double kSide = 385, kTall = 340;
    frame_equally(kSide, kTall, &x, &y);
    const Panel p(70 + 470 * static_cast<double>(panel), 96, kSide, kTall, x, y);
    out += p.axes(kAxisName[h], kAxisName[v]);
    out += p.path(truth[h], truth[v], starts, kTruth, 5);
    out += p.path(estimate[h], estimate[v], starts, kEstimate, 1.5);
    out += p.dot(estimate[h].front(), estimate[v].front(), kEstimate);
  }

  std::vector<double> seconds;
  for (const double t : e.timestamps) seconds.push_back(t - e.timestamps.front());
  const double duration = std::max(range_of(seconds).high, 1e-3), most = std::max(e.ape.translation.max, 1e-9);
  const Panel errors(70, 510, 855, 230, {0, duration}, {0, 1.1 * most});
  out += errors.axes("time since the first matched pose [s]", "APE [m]");
  out += errors.path(seconds, e.ape.translation_m, starts, kError, 1.2);
  out += errors.level(e.ape.translation.rmse, fmt::format("dashed: rmse {:.4f} m", e.ape.translation.rmse));
  return out + "</svg>\n";
}

}  // namespace dkb
