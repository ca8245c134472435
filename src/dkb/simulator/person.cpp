// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "dkb/simulator/movers.h"
#include "dkb/simulator/noise.h"

namespace dkb::sim {
namespace {

using Eigen::Vector3d;

TextureWindow look_of(int texture, float v0 = 0, float dv = 1) {
  TextureWindow w;
  w.texture = texture;
  w.v0 = v0;
  w.dv = dv;
  return w;
}

void limb(Surfaces* s, const Vector3d& a, const Vector3d& b, double ra, double rb, int texture) {
  const Vector3d axis = (b - a).normalized(), side = (Vector3d::UnitY() - axis * axis.y()).normalized();
  s->add_tube(a, b, side, ra, ra, rb / ra, look_of(texture));
  const Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  s->add_ellipsoid(a, axes, Vector3d::Constant(ra), look_of(texture));
  s->add_ellipsoid(b, axes, Vector3d::Constant(rb), look_of(texture));
}

}  // namespace

PersonLook make_person_look(Materials* materials, uint64_t seed) {
  Random random(hash64(seed, 0x9E12));
  PersonLook look;
  look.height = random.uniform(1.62, 1.88);
  look.girth = random.uniform(0.94, 1.12);
  look.shirt = materials->get(Material::fabric, random.next(), 1.0, 0.55);
  look.trousers = materials->get(Material::denim, random.next(), 0.5, 0.5);
  look.skin = materials->get(Material::skin, random.next(), 0.3, 0.3);
  look.face = materials->get(Material::face, random.next(), 0.5, 0.25);
  look.hair = materials->get(Material::hair, random.next(), 0.5, 0.25);
  look.shoes = materials->get(Material::rubber, random.next(), 0.3, 0.1);
  return look;
}

// Joint angles of a plain walk: thighs swing as a sine, knees bend while the leg swings forward, arms swing against the
// legs. x forward, y left, z up; the hips sink by what the stance leg's slant takes.
Surfaces person_surfaces(const PersonLook& look, const MoverState& state) {
  Surfaces s;
  const double k = look.height / 1.75, g = look.girth * k, stride = std::min(1.6, state.stride);
  const double hip_height = 0.90 * k, thigh = 0.43 * k, shin = 0.41 * k;
  const double swing = 0.48 * std::min(1.3, stride);
  const double sway = 0.015 * stride * std::sin(state.phase),
               sink = thigh * (1 - std::cos(swing)) * 0.5 * (1 + std::cos(2 * state.phase));
  const double lean = 0.04 * stride + (stride > 1.1 ? 0.12 * (stride - 1.1) : 0.0);
  const double base = hip_height - sink;
  const Vector3d hips(0, sway, base);
  const auto leaned = [&](double x, double y, double z) {  // part of the upper body at height z above the hips
    return Vector3d(hips.x() + x + z * std::sin(lean), hips.y() + y, hips.z() + z * std::cos(lean));
  };

  for (const double side : {-1.0, 1.0}) {
    const double phase = state.phase + (side > 0 ? 0.0 : 3.141592653589793);
    const double hip_angle = swing * std::sin(phase) + 0.1 * stride;
    const double bend =
        0.12 * stride + 0.9 * std::min(1.0, stride) * std::max(0.0, std::cos(phase)) * (0.6 + 0.3 * stride);
    const Vector3d hip = hips + Vector3d(0, side * 0.09 * g, 0);
    const Vector3d knee = hip + thigh * Vector3d(std::sin(hip_angle), 0, -std::cos(hip_angle));
    const double shin_angle = hip_angle - bend;
    const Vector3d ankle = knee + shin * Vector3d(std::sin(shin_angle), 0, -std::cos(shin_angle));
    limb(&s, hip, knee, 0.085 * g, 0.058 * g, look.trousers);
    limb(&s, knee, ankle, 0.058 * g, 0.042 * g, look.trousers);
    const double pitch = std::clamp(shin_angle, -1.0, 0.3);
    Eigen::Matrix3d foot = rotation_from_vector(Vector3d(0, -pitch, 0)).toRotationMatrix();
    s.add_ellipsoid(ankle + foot * Vector3d(0.055 * k, 0, -0.035 * k), foot, Vector3d(0.135, 0.05, 0.045) * k,
                    look_of(look.shoes));

    const double arm_angle = -0.9 * swing * std::sin(phase), elbow_bend = 0.25 + 0.5 * std::max(0.0, stride - 0.5);
    const double out = 0.09 + look.arms_out;
    const Vector3d shoulder = leaned(0, side * 0.195 * g, 0.50 * k);
    const Vector3d upper(std::sin(arm_angle) * std::cos(out), side * std::sin(out),
                         -std::cos(arm_angle) * std::cos(out));
    const Vector3d elbow = shoulder + 0.29 * k * upper;
    const double fore = arm_angle + elbow_bend;
    const Vector3d lower(std::sin(fore) * std::cos(out * 0.7), side * std::sin(out * 0.7),
                         -std::cos(fore) * std::cos(out * 0.7));
    const Vector3d wrist = elbow + 0.25 * k * lower;
    limb(&s, shoulder, elbow, 0.055 * g, 0.043 * g, look.shirt);
    limb(&s, elbow, wrist, 0.041 * g, 0.03 * g, look.skin);
    s.add_ellipsoid(wrist + 0.06 * k * lower, Eigen::Matrix3d::Identity(), Vector3d(0.04, 0.03, 0.06) * k,
                    look_of(look.skin));
  }

  const Eigen::Matrix3d tilt = rotation_from_vector(Vector3d(0, lean, 0)).toRotationMatrix();
  s.add_ellipsoid(leaned(0, 0, 0.01), tilt, Vector3d(0.12, 0.165, 0.13) * g, look_of(look.trousers));
  // Chest: an elliptic tube that widens towards the shoulders; radius 1 across, so that u = 0.5 is the front.
  s.add_tube(leaned(0, 0, 0.06 * k), leaned(0, 0, 0.46 * k), Vector3d::UnitX(), 0.105 * g, 0.15 * g, 1.2,
             look_of(look.shirt));
  s.add_ellipsoid(leaned(0, 0, 0.46 * k), tilt, Vector3d(0.125 * g, 0.2 * g, 0.1 * k), look_of(look.shirt, 0, 0.3F));
  limb(&s, leaned(0, 0, 0.5 * k), leaned(0.02, 0, 0.62 * k), 0.055 * k, 0.05 * k, look.skin);
  const Vector3d head = leaned(0.03, 0, 0.72 * k);
  s.add_ellipsoid(head, tilt, Vector3d(0.097, 0.078, 0.122) * k, look_of(look.face));
  s.add_ellipsoid(head + Vector3d(-0.022, 0, 0.028) * k, tilt, Vector3d(0.095, 0.086, 0.112) * k, look_of(look.hair));

  Rigid3 pose(Eigen::Quaterniond(Eigen::AngleAxisd(state.heading, Vector3d::UnitZ())),
              Vector3d(state.position.x(), state.position.y(), 0));
  if (!state.tilt.isZero(0))
    pose.rotation = pose.rotation * rotation_from_vector(Vector3d(state.tilt.x(), state.tilt.y(), 0));
  return s.moved(pose);
}

Surfaces Mover::surfaces(double t) const {
  const MoverState state = track.at(t);
  if (kind == "person") return person_surfaces(look, state);
  return rigid.moved(placed(state.position.x(), state.position.y(), 0, state.heading));
}

}  // namespace dkb::sim
