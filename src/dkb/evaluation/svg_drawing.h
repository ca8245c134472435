// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

namespace dkb::svg {

// Pieces of the pictures of this room. Coordinates are pixels of the picture, y downward, unless a Panel maps them.

inline constexpr const char* kInk = "#24292f";
inline constexpr const char* kGrid = "#e6e8eb";

// Text for SVG and HTML: markup escaped, control characters left out.
std::string escaped(const std::string& text);

// The opening of a picture with a white ground; "</svg>\n" closes it.
std::string opening(double width, double height);

// `anchor`: start, middle or end. `extra`: further attributes, with a space before them.
std::string label(double x, double y, const char* anchor, int size, const char* colour, const std::string& text,
                  const char* extra = "");

struct Range {
  double low = 0, high = 0;
  double length() const { return high - low; }
  double middle() const { return 0.5 * (low + high); }
};
Range range_of(const std::vector<double>& values);  // of at least one value

// Widens both ranges about their middles to one scale on a panel of that size, so that shapes are true. A point is
// widened to a metre, and nothing below what doubles of its size can tell apart.
void frame_equally(double width, double height, Range* x, Range* y);

// The largest of 1, 2 and 5 times a power of ten that cuts `length` > 0 into at least three pieces.
double tick_step(double length);
// Multiples of `step` in the range, rising: at most 20, none where doubles are too coarse to tell them apart.
std::vector<double> ticks(const Range& range, double step);
// `value` with as many decimals as ticks `step` apart need, as a power of ten where that is too long for an axis.
std::string tick_text(double value, double step);

// One diagram: maps values to a rectangle and draws grid, axes and lines.
class Panel {
 public:
  Panel(double left, double top, double width, double height, Range x, Range y)
      : left_(left), top_(top), width_(width), height_(height), x_(x), y_(y) {}

  std::string axes(const std::string& x_name, const std::string& y_name) const;
  std::string y_axis(const std::string& y_name) const;  // grid lines, ticks and frame, for an x that has no numbers
  // `starts`: where a new stretch begins; between stretches nothing is drawn. `extra`: further attributes.
  std::string path(const std::vector<double>& x, const std::vector<double>& y, const std::vector<size_t>& starts,
                   const char* colour, double width, const char* extra = "") const;
  std::string dot(double x, double y, const char* colour) const;
  std::string level(double y, const std::string& text) const;  // a dashed line across, named above the panel
  double px(double x) const { return left_ + (x - x_.low) / x_.length() * width_; }
  double py(double y) const { return top_ + height_ - (y - y_.low) / y_.length() * height_; }

 private:
  std::string frame() const;

  double left_, top_, width_, height_;
  Range x_, y_;
};

// Two of the axes x, y, z [m] against each other.
struct Projection {
  size_t across = 0, up = 0;
  Panel panel;
  std::string axes() const;
};
// The axis of the widest extent against each of the other two, the wider first, side by side at the height `top`;
// shapes are true.
std::vector<Projection> widest_projections(const std::array<Range, 3>& range, double top, double height);

// Indices at which a stretch without gaps begins; a gap is ten usual steps between stamps.
std::vector<size_t> stretches(const std::vector<double>& timestamps);

}  // namespace dkb::svg
