// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <vector>

#include "dkb/geometry/rigid3.h"

namespace dkb::sim {

// Part of a texture: texture coordinate = origin + size * surface coordinate.
struct TextureWindow {
  int texture = 0;
  float u0 = 0, v0 = 0, du = 1, dv = 1;
};

// Parallelogram seen from its front only: point = origin + a * u + b * v, a and b in [0, 1]; the front is where
// u x v points away from the viewer (u right, v down, as in the picture on it). `disc`: only the inscribed ellipse.
struct Patch {
  Eigen::Vector3d origin, u, v;  // [m]
  TextureWindow look;
  float shade = 1;
  bool disc = false;
};

// Ellipsoid or tapered tube. In local coordinates l = to_local * (point - centre):
//   ellipsoid: |l| = 1;   tube: |l.xy| = radius + taper * l.z, 0 <= l.z <= 1.
// Texture: u once around the local z axis (0.5 at local +x), v from the top (largest z) down.
struct Quadric {
  Eigen::Matrix3d to_local;
  Eigen::Vector3d centre;
  bool tube = false;
  double radius = 1, taper = 0;
  TextureWindow look;
};

struct Surfaces {
  std::vector<Patch> patches;
  std::vector<Quadric> quadrics;

  void append(const Surfaces& other);
  Surfaces moved(const Rigid3& to_from_from) const;

  // The six faces of a box with corner `corner` and edges ex, ey, ez (right-handed). Faces with texture < 0 are left
  // out. Order: -x, +x, -y, +y, -z, +z.
  void add_box(const Eigen::Vector3d& corner, const Eigen::Vector3d& ex, const Eigen::Vector3d& ey,
               const Eigen::Vector3d& ez, const std::array<int, 6>& textures);
  void add_ellipsoid(const Eigen::Vector3d& centre, const Eigen::Matrix3d& axes, const Eigen::Vector3d& radii,
                     const TextureWindow& look);
  // Tube from a to b with radii in the directions of `side` (made orthogonal to the axis) and across it; the radii at b
  // are `end_scale` times those at a.
  void add_tube(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& side, double radius_side,
                double radius_across, double end_scale, const TextureWindow& look);
  void add_disc(const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, double radius, const TextureWindow& look);
};

// Shade of a surface with outward normal `n` under the room's lamps, about 0.6 ... 1.
inline float lambert_shade(const Eigen::Vector3d& n) {
  // Unit vectors to a window and to a lamp.
  const Eigen::Vector3d lamp(0.348, -0.497, 0.795), other(-0.835, 0.358, 0.418);
  return static_cast<float>(0.66 + 0.26 * std::max(0.0, n.dot(lamp)) + 0.14 * std::max(0.0, n.dot(other)));
}

}  // namespace dkb::sim
