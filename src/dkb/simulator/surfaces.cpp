// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/surfaces.h"

#include <algorithm>
#include <array>

namespace dkb::sim {
namespace {

Patch make_patch(const Eigen::Vector3d& origin, const Eigen::Vector3d& u, const Eigen::Vector3d& v, int texture) {
  Patch p;
  p.origin = origin;
  p.u = u;
  p.v = v;
  p.look.texture = texture;
  p.shade = lambert_shade(-u.cross(v).normalized());
  return p;
}

}  // namespace

void Surfaces::append(const Surfaces& other) {
  patches.insert(patches.end(), other.patches.begin(), other.patches.end());
  quadrics.insert(quadrics.end(), other.quadrics.begin(), other.quadrics.end());
}

Surfaces Surfaces::moved(const Rigid3& m) const {
  Surfaces out = *this;
  const Eigen::Matrix3d r = m.matrix3();
  for (Patch& p : out.patches) {
    p.origin = m * p.origin;
    p.u = r * p.u;
    p.v = r * p.v;
    p.shade = lambert_shade(-p.u.cross(p.v).normalized());
  }
  for (Quadric& q : out.quadrics) {
    q.centre = m * q.centre;
    q.to_local = q.to_local * r.transpose();
  }
  return out;
}

void Surfaces::add_box(const Eigen::Vector3d& c, const Eigen::Vector3d& ex, const Eigen::Vector3d& ey,
                       const Eigen::Vector3d& ez, const std::array<int, 6>& t) {
  // Pictures stand upright on the sides: v = -z; on top and bottom u = x.
  if (t[0] >= 0) patches.push_back(make_patch(c + ey + ez, -ey, -ez, t[0]));
  if (t[1] >= 0) patches.push_back(make_patch(c + ex + ez, ey, -ez, t[1]));
  if (t[2] >= 0) patches.push_back(make_patch(c + ez, ex, -ez, t[2]));
  if (t[3] >= 0) patches.push_back(make_patch(c + ex + ey + ez, -ex, -ez, t[3]));
  if (t[4] >= 0) patches.push_back(make_patch(c, ex, ey, t[4]));
  if (t[5] >= 0) patches.push_back(make_patch(c + ey + ez, ex, -ey, t[5]));
}

void Surfaces::add_ellipsoid(const Eigen::Vector3d& centre, const Eigen::Matrix3d& axes, const Eigen::Vector3d& radii,
                             const TextureWindow& look) {
  Quadric q;
  q.centre = centre;
  q.to_local = radii.cwiseInverse().asDiagonal() * axes.transpose();
  q.look = look;
  quadrics.push_back(q);
}

void Surfaces::add_tube(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& side,
                        double radius_side, double radius_across, double end_scale, const TextureWindow& look) {
  const double length = (b - a).norm();
  const Eigen::Vector3d z = (b - a) / length, x = (side - z * z.dot(side)).normalized(), y = z.cross(x);
  Quadric q;
  q.centre = a;
  q.to_local.row(0) = x.transpose() / radius_side;
  q.to_local.row(1) = y.transpose() / radius_across;
  q.to_local.row(2) = z.transpose() / length;
  q.tube = true;
  q.taper = end_scale - 1;
  q.look = look;
  quadrics.push_back(q);
}

void Surfaces::add_disc(const Eigen::Vector3d& centre, const Eigen::Vector3d& normal, double radius,
                        const TextureWindow& look) {
  const Eigen::Vector3d n = normal.normalized(),
                        seed = std::abs(n.x()) < 0.9 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  const Eigen::Vector3d u = 2 * radius * (seed - n * n.dot(seed)).normalized(), v = u.cross(n);
  Patch p = make_patch(centre - 0.5 * (u + v), u, v, look.texture);
  p.look = look;
  p.disc = true;
  patches.push_back(p);
}

}  // namespace dkb::sim
