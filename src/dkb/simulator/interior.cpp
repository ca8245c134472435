// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/interior.h"

#include <cmath>

namespace dkb::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

}  // namespace

Rigid3 Interior::frame_of(const Vector2d& a, const Vector2d& b) {
  return placed(a.x(), a.y(), 0, std::atan2(b.y() - a.y(), b.x() - a.x()));
}

// Rectangle in the wall's plane moved by y into the room, seen from there.
void Interior::face(const Rigid3& frame, double x0, double x1, double z0, double z1, double y, int texture) {
  Surfaces s;
  s.add_box({x0, y - 0.001, z0}, {x1 - x0, 0, 0}, {0, 0.001, 0}, {0, 0, z1 - z0}, {-1, -1, -1, texture, -1, -1});
  target_->surfaces.append(s.moved(frame));
}

void Interior::floor(const Footprint& area, Material material) {
  Surfaces s;
  const double w = area.x1 - area.x0, d = area.y1 - area.y0;
  const int t = materials_->get(material, seed_, w, d);
  s.add_box({area.x0, area.y0, -0.01}, {w, 0, 0}, {0, d, 0}, {0, 0, 0.01}, {-1, -1, -1, -1, -1, t});
  s.patches.back().shade = 0.85F;
  target_->surfaces.append(s);
}

void Interior::ceiling(const Footprint& area) {
  Surfaces s;
  const double w = area.x1 - area.x0, d = area.y1 - area.y0;
  s.add_box({area.x0, area.y0, height_}, {w, 0, 0}, {0, d, 0}, {0, 0, 0.01}, {-1, -1, -1, -1, paint(w, d), -1});
  s.patches.back().shade = 0.95F;
  target_->surfaces.append(s);
}

void Interior::wall(const Vector2d& a, const Vector2d& b, const std::vector<Opening>& openings) {
  const Rigid3 frame = frame_of(a, b);
  const double length = (b - a).norm();
  const auto piece = [&](double x0, double x1) {
    if (x1 - x0 < 1e-6) return;
    face(frame, x0, x1, 0, height_, 0, paint(x1 - x0, height_));
  };
  double x = 0;
  for (const Opening& o : openings) {
    piece(x, o.from);
    if (height_ - o.height > 1e-6) face(frame, o.from, o.to, o.height, height_, 0, paint(o.to - o.from, 0.5));
    x = o.to;
  }
  piece(x, length);
}

void Interior::frame(const Vector2d& a, const Vector2d& b, const Opening& o) {
  Surfaces s;
  const int t = materials_->get(Material::lacquer, seed_ + 1, 2.0, 0.1);
  const double wide = 0.07, thick = 0.016;
  for (const double x : {o.from - wide, o.to})
    s.add_box({x, 0, 0}, {wide, 0, 0}, {0, thick, 0}, {0, 0, o.height + wide}, {t, t, -1, t, -1, t});
  s.add_box({o.from, 0, o.height}, {o.to - o.from, 0, 0}, {0, thick, 0}, {0, 0, wide}, {-1, -1, -1, t, t, t});
  target_->surfaces.append(s.moved(frame_of(a, b)));
}

void Interior::reveal(const Vector2d& a, const Vector2d& b, const Opening& o, double depth, int side, int back) {
  Surfaces s;
  const double w = o.to - o.from;
  const int ground = materials_->get(Material::linoleum, seed_, w, depth);
  s.add_box({o.from - 0.01, -depth, 0}, {0.01, 0, 0}, {0, depth, 0}, {0, 0, o.height}, {-1, side, -1, -1, -1, -1});
  s.add_box({o.to, -depth, 0}, {0.01, 0, 0}, {0, depth, 0}, {0, 0, o.height}, {side, -1, -1, -1, -1, -1});
  s.add_box({o.from, -depth, o.height}, {w, 0, 0}, {0, depth, 0}, {0, 0, 0.01}, {-1, -1, -1, -1, side, -1});
  s.add_box({o.from, -depth, -0.01}, {w, 0, 0}, {0, depth, 0}, {0, 0, 0.01}, {-1, -1, -1, -1, -1, ground});
  s.patches.back().shade = 0.85F;
  s.add_box({o.from, -depth - 0.01, 0}, {w, 0, 0}, {0, 0.01, 0}, {0, 0, o.height}, {-1, -1, -1, back, -1, -1});
  target_->surfaces.append(s.moved(frame_of(a, b)));
}

void Interior::niche(const Vector2d& a, const Vector2d& b, const Opening& o, double depth) {
  reveal(a, b, o, depth, paint(depth, o.height), paint(o.to - o.from, o.height));
}

void Interior::closed_door(const Vector2d& a, const Vector2d& b, const Opening& o, double depth) {
  frame(a, b, o);
  reveal(a, b, o, depth, materials_->get(Material::lacquer, seed_ + 1, 2.0, 0.1),
         materials_->get(Material::lacquer, seed_ + 1, o.to - o.from, o.height));
  Surfaces s;
  const int metal = materials_->get(Material::metal, 2, 0.1, 0.1);
  s.add_box({o.to - 0.17, -depth, 1.03}, {0.12, 0, 0}, {0, 0.05, 0}, {0, 0, 0.02},
            {metal, metal, -1, metal, metal, metal});
  target_->surfaces.append(s.moved(frame_of(a, b)));
}

void Interior::pillar(const Vector2d& a, const Vector2d& b, double from, double to, double depth) {
  Surfaces s;
  const int t = paint(to - from, height_), side = paint(depth, height_);
  s.add_box({from, 0, 0}, {to - from, 0, 0}, {0, depth, 0}, {0, 0, height_}, {side, side, -1, t, -1, -1});
  target_->surfaces.append(s.moved(frame_of(a, b)));
}

void Interior::pane(const Vector2d& a, const Vector2d& b, Surfaces* glass) {
  const Rigid3 frame = frame_of(a, b);
  const double length = (b - a).norm(), bar = 0.05;
  const int metal = materials_->get(Material::metal, 7, 2.0, bar);
  Surfaces s;
  const auto box = [&](double x, double z, double w, double h) {
    s.add_box({x, -bar / 2, z}, {w, 0, 0}, {0, bar, 0}, {0, 0, h}, {metal, metal, metal, metal, metal, metal});
  };
  box(0, 0, length, bar);
  box(0, height_ - bar, length, bar);
  const int parts = std::max(1, static_cast<int>(std::lround(length / 1.2)));
  for (int i = 0; i <= parts; ++i) box((length - bar) * i / parts, bar, bar, height_ - 2 * bar);
  const int stripe = materials_->get(Material::poster, 11, 1.0, 0.06);
  for (const double z : {0.95, 1.45})
    s.add_box({0, -0.001, z}, {length, 0, 0}, {0, 0.002, 0}, {0, 0, 0.05}, {-1, -1, stripe, stripe, -1, -1});
  target_->surfaces.append(s.moved(frame));
  // One patch for either side to see.
  Surfaces both;
  both.add_box({0, -0.003, 0}, {length, 0, 0}, {0, 0.006, 0}, {0, 0, height_}, {-1, -1, metal, metal, -1, -1});
  glass->append(both.moved(frame));
}

}  // namespace dkb::sim
