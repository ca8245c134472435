// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/cells.h"

#include <algorithm>
#include <cmath>

namespace dkb::sim {
namespace {

using Eigen::Vector2d;

constexpr int kMostPortals = 12;  // in a row

struct Interval {
  double low, high;  // [rad] left of the camera's heading
};

class View {
 public:
  View(const std::vector<Cell>& cells, const Vector2d& eye, double heading, double slack)
      : cells_(cells), eye_(eye), ahead_(std::cos(heading), std::sin(heading)), slack_(slack), seen_(cells.size()) {}

  void enter(size_t cell, size_t from, const Interval& view, int depth) {
    seen_[cell] = true;
    if (depth == kMostPortals) return;
    for (const Portal& p : cells_[cell].portals) {
      const auto to = static_cast<size_t>(p.to);
      if (to == from) continue;
      const Interval through = cut(p, view);
      if (through.low < through.high) enter(to, cell, through, depth + 1);
    }
  }
  const std::vector<bool>& seen() const { return seen_; }

 private:
  Interval cut(const Portal& p, const Interval& view) const {
    const Vector2d along = p.b - p.a;
    const double s = std::clamp((eye_ - p.a).dot(along) / along.squaredNorm(), 0.0, 1.0);
    const double distance = (p.a + s * along - eye_).norm();
    if (distance < 0.3 + slack_) return view;  // about to go through
    // (ahead, left) of both ends, the part behind cut off.
    const auto seen_from_eye = [&](const Vector2d& q) {
      const Vector2d d = q - eye_;
      return Vector2d(ahead_.dot(d), ahead_.x() * d.y() - ahead_.y() * d.x());
    };
    Vector2d a = seen_from_eye(p.a), b = seen_from_eye(p.b);
    constexpr double kNear = 1e-3;
    if (a.x() < kNear && b.x() < kNear) return {0, 0};
    if (a.x() < kNear) a += (kNear - a.x()) / (b.x() - a.x()) * (b - a);
    if (b.x() < kNear) b += (kNear - b.x()) / (a.x() - b.x()) * (a - b);
    const double u = std::atan2(a.y(), a.x()), v = std::atan2(b.y(), b.x()), more = slack_ / distance + 0.01;
    return {std::max(view.low, std::min(u, v) - more), std::min(view.high, std::max(u, v) + more)};
  }

  const std::vector<Cell>& cells_;
  const Vector2d eye_, ahead_;
  const double slack_;
  std::vector<bool> seen_;
};

}  // namespace

size_t cell_at(const std::vector<Cell>& cells, const Vector2d& place) {
  size_t best = 0;
  double nearest = 1e9;
  for (size_t i = 0; i < cells.size(); ++i) {
    const double d = cells[i].area.distance(place.x(), place.y());
    if (d >= nearest) continue;
    nearest = d;
    best = i;
  }
  return best;
}

std::vector<bool> visible_cells(const std::vector<Cell>& cells, const CameraModel& camera, const Rigid3& scene_from_cam,
                                double slack) {
  const Eigen::Vector3d axis = scene_from_cam.rotation * Eigen::Vector3d::UnitZ();
  const double heading = std::atan2(axis.y(), axis.x());
  double half = 0;
  for (const double x : {0.0, camera.width - 1.0})
    for (const double y : {0.0, camera.height - 1.0}) {
      const Eigen::Vector3d ray = scene_from_cam.rotation * camera.unproject({x, y}, 1.0);
      half = std::max(half, std::abs(std::remainder(std::atan2(ray.y(), ray.x()) - heading, 6.283185307179586)));
    }
  half = std::min(half + slack + 0.02, 1.5);
  const Vector2d eye = scene_from_cam.translation.head<2>();
  View view(cells, eye, heading, slack);
  view.enter(cell_at(cells, eye), cells.size(), {-half, half}, 0);
  return view.seen();
}

}  // namespace dkb::sim
