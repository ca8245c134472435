// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/route.h"

#include <algorithm>
#include <cmath>

namespace dkb::sim {
namespace {

using Eigen::Vector2d;

Vector2d direction(double heading) {
  return {std::cos(heading), std::sin(heading)};
}

}  // namespace

Route::Route(const std::vector<RouteCorner>& corners) {
  Vector2d here = corners.front().place;
  const Vector2d first = corners[1].place - here;
  double heading = std::atan2(first.y(), first.x()), start = 0;
  const auto add = [&](double length, double curvature) {
    pieces_.push_back({start, length, here, heading, curvature});
    start += length;
    here = at(start).position;
    heading += length * curvature;
  };
  for (size_t i = 1; i < corners.size(); ++i) {
    const Vector2d to = corners[i].place - here;
    if (i + 1 == corners.size()) {
      add(to.norm(), 0);
      break;
    }
    const Vector2d next = corners[i + 1].place - corners[i].place;
    const double turn = std::remainder(std::atan2(next.y(), next.x()) - heading, 6.283185307179586);
    add(to.norm() - corners[i].radius * std::tan(std::abs(turn) / 2), 0);
    if (std::abs(turn) > 1e-9) add(std::abs(turn) * corners[i].radius, (turn > 0 ? 1 : -1) / corners[i].radius);
  }
}

Route::Place Route::at(double metres) const {
  auto it =
      std::upper_bound(pieces_.begin(), pieces_.end(), metres, [](double s, const Piece& p) { return s < p.start; });
  const Piece& p = it == pieces_.begin() ? *it : *std::prev(it);
  const double s = metres - p.start, turned = s * p.curvature;
  Place out{p.from, p.heading + turned, p.curvature};
  if (p.curvature == 0)
    out.position += s * direction(p.heading);
  else
    out.position += Vector2d(std::sin(p.heading + turned) - std::sin(p.heading),
                             std::cos(p.heading) - std::cos(p.heading + turned)) /
                    p.curvature;
  return out;
}

std::vector<TimedPose> Route::drive(double duration, const Drive& how) const {
  constexpr int kPerMetre = 50;
  const auto n = static_cast<size_t>(std::ceil(length() * kPerMetre));
  const double step = length() / static_cast<double>(n);
  // Times at which each step is reached, for a top speed.
  const auto times = [&](double top) {
    std::vector<double> v(n + 1, 0.0), t(n + 1, 0.0);
    for (size_t i = 1; i < n; ++i) {
      const double k = std::abs(at(step * static_cast<double>(i)).curvature);
      v[i] = std::min(
          {top, k > 0 ? how.turn_rate / k : top, std::sqrt(v[i - 1] * v[i - 1] + 2 * how.acceleration * step)});
    }
    for (size_t i = n; i-- > 1;) v[i] = std::min(v[i], std::sqrt(v[i + 1] * v[i + 1] + 2 * how.acceleration * step));
    for (size_t i = 1; i <= n; ++i) t[i] = t[i - 1] + 2 * step / (v[i - 1] + v[i]);
    return t;
  };
  double low = length() / duration, high = 10;
  for (int i = 0; i < 40; ++i) {
    const double middle = (low + high) / 2;
    (times(middle).back() > duration ? low : high) = middle;
  }
  const std::vector<double> t = times(high);
  std::vector<TimedPose> poses;
  for (size_t i = 0; i <= n; ++i) {
    const Place p = at(step * static_cast<double>(i));
    poses.push_back({t[i], camera_pose({p.position.x(), p.position.y(), how.height}, p.heading, how.pitch)});
  }
  return poses;
}

}  // namespace dkb::sim
