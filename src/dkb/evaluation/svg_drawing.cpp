// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/svg_drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace dkb::svg {
namespace {

int decimals_of(double step) {
  return std::max(0, static_cast<int>(-std::floor(std::log10(step) + 1e-9)));
}

std::string line(double x1, double y1, double x2, double y2) {
  return fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\"/>\n", x1, y1, x2, y2,
                     kGrid);
}

}  // namespace

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

std::string opening(double width, double height) {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\" "
      "font-family=\"Helvetica, Arial, sans-serif\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"#ffffff\"/>\n",
      width, height);
}

std::string label(double x, double y, const char* anchor, int size, const char* colour, const std::string& text,
                  const char* extra) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" font-size=\"{}\" fill=\"{}\"{}>{}</text>\n", x,
                     y, anchor, size, colour, extra, escaped(text));
}

Range range_of(const std::vector<double>& values) {
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {*low, *high};
}

double tick_step(double length) {
  const double raw = length / 3.0;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  for (const double factor : {5.0, 2.0, 1.0})
    if (factor * power <= raw * (1 + 1e-9)) return factor * power;
  return power;
}

std::vector<double> ticks(const Range& range, double step) {
  constexpr int kMost = 20;
  const double first = std::ceil(range.low / step - 1e-9);
  std::vector<double> out;
  for (int i = 0; i < kMost; ++i) {
    const double value = (first + i) * step;
    if (!(value <= range.high + 1e-9 * step)) break;  // also what is no number
    if (out.empty() || value > out.back()) out.push_back(value);
  }
  return out;
}

std::string tick_text(double value, double step) {
  constexpr size_t kLongest = 8, kLongestExact = 10;  // [characters] that stay beside the axis' name
  if (std::abs(value) < 1e-9 * step) value = 0;
  std::string text = fmt::format("{:.{}f}", value, decimals_of(step));
  if (text.size() <= kLongest) return text;
  if (value == 0) return "0";
  const int digits = static_cast<int>(std::floor(std::log10(std::abs(value))) - std::floor(std::log10(step) + 1e-9));
  // With more digits a power of ten would no longer tell ticks apart.
  if (digits > 2 && text.size() <= kLongestExact) return text;
  return fmt::format("{:.{}e}", value, std::clamp(digits, 0, 2));
}

std::string Panel::frame() const {
  return fmt::format(
      "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"none\" stroke=\"{}\"/>\n", left_, top_,
      width_, height_, kInk);
}

std::string Panel::y_axis(const std::string& y_name) const {
  std::string out;
  const double step = tick_step(y_.length());
  for (const double value : ticks(y_, step)) {
    const double at = py(value);
    out += line(left_, at, left_ + width_, at);
    out += label(left_ - 6, at + 4, "end", 11, kInk, tick_text(value, step));
  }
  const double x = left_ - 52, y = top_ + height_ / 2;
  out += label(x, y, "middle", 12, kInk, y_name, fmt::format(" transform=\"rotate(-90 {:.1f} {:.1f})\"", x, y).c_str());
  return out + frame();
}

std::string Panel::axes(const std::string& x_name, const std::string& y_name) const {
  std::string out;
  const double step = tick_step(x_.length());
  for (const double value : ticks(x_, step)) {
    const double at = px(value);
    out += line(at, top_, at, top_ + height_);
    out += label(at, top_ + height_ + 16, "middle", 11, kInk, tick_text(value, step));
  }
  out += y_axis(y_name);
  return out + label(left_ + width_ / 2, top_ + height_ + 34, "middle", 12, kInk, x_name);
}

std::string Panel::path(const std::vector<double>& x, const std::vector<double>& y, const std::vector<size_t>& starts,
                        const char* colour, double width, const char* extra) const {
  std::string out;
  for (size_t k = 0; k < starts.size(); ++k) {
    const size_t end = k + 1 < starts.size() ? starts[k + 1] : x.size();
    std::string points;
    for (size_t i = starts[k]; i < end; ++i) points += fmt::format("{:.1f},{:.1f} ", px(x[i]), py(y[i]));
    points.pop_back();
    out += fmt::format(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\" "
        "stroke-linecap=\"round\"{}/>\n",
        points, colour, width, extra);
  }
  return out;
}

std::string Panel::dot(double x, double y, const char* colour) const {
  return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4\" fill=\"{}\"/>\n", px(x), py(y), colour);
}

std::string Panel::level(double y, const std::string& text) const {
  return fmt::format(
             "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" stroke-dasharray=\"5 4\"/>\n",
             left_, py(y), left_ + width_, py(y), kInk) +
         label(left_ + width_, top_ - 6, "end", 12, kInk, text);
}

std::string Projection::axes() const {
  static constexpr const char* kAxisName[] = {"x [m]", "y [m]", "z [m]"};
  return panel.axes(kAxisName[across], kAxisName[up]);
}

std::vector<Projection> widest_projections(const std::array<Range, 3>& range, double top, double height) {
  constexpr double kLeft = 70, kStep = 470, kSide = 385;  // [px]
  std::array<size_t, 3> order{0, 1, 2};
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return range[a].length() > range[b].length(); });
  std::vector<Projection> result;
  for (size_t side = 0; side < 2; ++side) {
    const size_t across = order[0], up = order[side + 1];
    Range x = range[across], y = range[up];
    frame_equally(kSide, height, &x, &y);
    result.push_back({across, up, Panel(kLeft + kStep * static_cast<double>(side), top, kSide, height, x, y)});
  }
  return result;
}

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

void frame_equally(double width, double height, Range* x, Range* y) {
  double metres_per_px = 1.12 * std::max(x->length() / width, y->length() / height);
  if (metres_per_px < 1e-12) metres_per_px = 1.0 / width;
  const double size = std::max({std::abs(x->low), std::abs(x->high), std::abs(y->low), std::abs(y->high)});
  metres_per_px = std::max(metres_per_px, 1e-12 * size);
  *x = {x->middle() - 0.5 * metres_per_px * width, x->middle() + 0.5 * metres_per_px * width};
  *y = {y->middle() - 0.5 * metres_per_px * height, y->middle() + 0.5 * metres_per_px * height};
}

}  // namespace dkb::svg
