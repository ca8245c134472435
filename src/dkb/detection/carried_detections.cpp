// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/carried_detections.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "dkb/util/quantile.h"

namespace dkb {
namespace {

constexpr size_t kMinPoints = 4;        // followed inside a box below which it is not moved, only grown
constexpr float kMaxScaleStep = 1.05f;  // largest change of size per frame carried, either way
constexpr float kGrowth = 1.0f;         // [px] per frame and side, for what flow does not tell
constexpr float kBlindGrowth = 0.02f;   // share of the box per frame and side, more, for boxes without enough points

// How one coordinate moves: to = centre + scale * (from - centre) + shift, where the shift lies within low ... high.
struct AxisMotion {
  float centre = 0, scale = 1, low = 0, middle = 0, high = 0;

  float at(float value, float shift) const { return centre + scale * (value - centre) + shift; }
};

using Points = std::vector<const PointMotion*>;

// `axis`: 0 = x, 1 = y.
AxisMotion axis_motion(const Points& points, Eigen::Index axis, float centre, float scale) {
  AxisMotion motion{centre, scale, 0, 0, 0};
  std::vector<float> shifts;
  for (const PointMotion* p : points) shifts.push_back(p->to[axis] - motion.at(p->from[axis], 0));
  motion.low = quantile(shifts, 0.25);
  motion.middle = quantile(shifts, 0.5);
  motion.high = quantile(shifts, 0.75);
  return motion;
}

// Median ratio of the points' distances to their (median) centre, after and before.
float scale_change(const Points& points, float limit) {
  const auto centre = [&](Eigen::Vector2f PointMotion::*end) {
    std::vector<float> x, y;
    for (const PointMotion* p : points) x.push_back((p->*end).x()), y.push_back((p->*end).y());
    return Eigen::Vector2f(upper_median(x), upper_median(y));
  };
  const Eigen::Vector2f from = centre(&PointMotion::from), to = centre(&PointMotion::to);
  constexpr float kNear = 4;  // [px] shorter distances tell more of noise than of scale
  std::vector<float> ratios;
  for (const PointMotion* p : points) {
    const float before = std::hypot(p->from.x() - from.x(), p->from.y() - from.y());
    if (before >= kNear) ratios.push_back(std::hypot(p->to.x() - to.x(), p->to.y() - to.y()) / before);
  }
  return ratios.size() < 3 ? 1.0f : std::clamp(upper_median(ratios), 1 / limit, limit);
}

// Points of each box: its own (no smaller box holds them), or all inside it where these are too few.
std::vector<Points> points_of(const std::vector<Detection>& boxes, std::span<const PointMotion> motions) {
  std::vector<Points> own(boxes.size()), inside(boxes.size());
  for (const PointMotion& p : motions) {
    if (!p.from.allFinite() || !p.to.allFinite()) continue;
    for (size_t i = 0; i < boxes.size(); ++i)
      if (boxes[i].box.contains(p.from.x(), p.from.y())) inside[i].push_back(&p);
    const int smallest = smallest_box_at(boxes, p.from.x(), p.from.y());
    if (smallest >= 0) own[static_cast<size_t>(smallest)].push_back(&p);
  }
  for (size_t i = 0; i < boxes.size(); ++i)
    if (own[i].size() < kMinPoints) own[i] = std::move(inside[i]);
  return own;
}

// Takes the mask's pixels inside `from` to where they move.
void move_mask(const GreyImage& mask, const Box& from, const AxisMotion& x_motion, const AxisMotion& y_motion,
               GreyImage* out) {
  const auto source = [](const AxisMotion& m, int value) {
    return static_cast<int>(std::lround(m.centre + (static_cast<float>(value) - m.middle - m.centre) / m.scale));
  };
  const auto first = [](const AxisMotion& m, float value) {
    return std::max(0, static_cast<int>(std::floor(m.at(value, m.middle))) - 1);
  };
  const auto last = [](const AxisMotion& m, float value, int size) {
    return std::min(size - 1, static_cast<int>(std::ceil(m.at(value, m.middle))) + 1);
  };
  for (int y = first(y_motion, from.y); y <= last(y_motion, from.y + from.h, mask.height()); ++y) {
    const int sy = source(y_motion, y);
    for (int x = first(x_motion, from.x); x <= last(x_motion, from.x + from.w, mask.width()); ++x) {
      const int sx = source(x_motion, x);
      if (mask.contains(sx, sy) && mask(sx, sy) != 0 && from.contains(static_cast<float>(sx), static_cast<float>(sy)))
        (*out)(x, y) = 255;
    }
  }
}

}  // namespace

Detections carry(const Detections& from, std::span<const PointMotion> motions, int frames, int width, int height,
                 std::vector<size_t>* kept) {
  if (frames <= 0) return from;
  const std::vector<Points> points = points_of(from.boxes, motions);
  const auto steps = static_cast<float>(frames);
  const float scale_limit = std::pow(kMaxScaleStep, steps);
  Detections to;
  to.mask = from.mask;
  if (!to.mask.empty())
    for (const Detection& d : from.boxes)
      for_each_pixel(d.box, to.mask.width(), to.mask.height(), [&](int x, int y) { to.mask(x, y) = 0; });
  for (size_t i = 0; i < from.boxes.size(); ++i) {
    const Detection& d = from.boxes[i];
    const float cx = d.box.x + d.box.w / 2, cy = d.box.y + d.box.h / 2;
    AxisMotion x_motion{cx, 1, 0, 0, 0}, y_motion{cy, 1, 0, 0, 0};
    float growth = kGrowth * steps;
    if (points[i].size() < kMinPoints) {
      growth += kBlindGrowth * steps * std::max(d.box.w, d.box.h);
    } else {
      const float scale = scale_change(points[i], scale_limit);
      x_motion = axis_motion(points[i], 0, cx, scale);
      y_motion = axis_motion(points[i], 1, cy, scale);
    }
    const float left = x_motion.at(d.box.x, x_motion.low) - growth;
    const float top = y_motion.at(d.box.y, y_motion.low) - growth;
    const float right = x_motion.at(d.box.x + d.box.w, x_motion.high) + growth;
    const float bottom = y_motion.at(d.box.y + d.box.h, y_motion.high) + growth;
    const Box box = clip({left, top, right - left, bottom - top}, width, height);
    if (box.w > 0 && box.h > 0) {
      to.boxes.push_back({d.class_name, box, d.score});
      if (kept != nullptr) kept->push_back(i);
    }
    if (!to.mask.empty()) move_mask(from.mask, d.box, x_motion, y_motion, &to.mask);
  }
  return to;
}

}  // namespace dkb
