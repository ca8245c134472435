// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/furniture.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "dkb/simulator/noise.h"

namespace dkb::sim {
namespace {

using Eigen::Vector3d;

// Box by corner and size, axes of the local frame; textures as in Surfaces::add_box.
void box(Surfaces* s, const Vector3d& corner, const Vector3d& size, const std::array<int, 6>& t) {
  s->add_box(corner, Vector3d(size.x(), 0, 0), Vector3d(0, size.y(), 0), Vector3d(0, 0, size.z()), t);
}
std::array<int, 6> all(int t) {
  return {t, t, t, t, t, t};
}

void tube(Surfaces* s, const Vector3d& a, const Vector3d& b, double radius, int texture, double end_scale = 1) {
  const Vector3d side = std::abs((b - a).normalized().x()) < 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
  TextureWindow look;
  look.texture = texture;
  s->add_tube(a, b, side, radius, radius, end_scale, look);
}

}  // namespace

double Footprint::distance(double x, double y) const {
  const double dx = std::max({x0 - x, 0.0, x - x1}), dy = std::max({y0 - y, 0.0, y - y1});
  return std::hypot(dx, dy);
}

Rigid3 placed(double x, double y, double z, double yaw) {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Vector3d::UnitZ())), Vector3d(x, y, z)};
}

Furnisher::Furnisher(Materials* materials, Furnishing* target, uint64_t seed, uint64_t variation)
    : materials_(materials),
      target_(target),
      seed_(hash64(seed, 77)),
      variation_(variation),
      random_(hash64(seed, 1)),
      details_(hash64(seed, 2, variation)) {}

int Furnisher::texture(Material material, uint32_t kinds, double width, double height) {
  return materials_->get(material, hash64(seed_, random_.below(kinds)), width, height);
}
int Furnisher::detail(Material material, uint32_t kinds, double width, double height) {
  const uint32_t usual = random_.below(kinds), other = details_.below(kinds);
  const bool differs = details_.uniform() < 0.2 && variation_ != 0;
  return materials_->get(material, hash64(seed_, differs ? other : usual), width, height);
}

void Furnisher::reserve(const Rigid3& at, double x0, double y0, double x1, double y1) {
  Footprint f{1e9, 1e9, -1e9, -1e9};
  for (const Vector3d& corner : {Vector3d(x0, y0, 0), Vector3d(x1, y0, 0), Vector3d(x0, y1, 0), Vector3d(x1, y1, 0)}) {
    const Vector3d p = at * corner;
    f = {std::min(f.x0, p.x()), std::min(f.y0, p.y()), std::max(f.x1, p.x()), std::max(f.y1, p.y())};
  }
  target_->footprints.push_back(f);
}

void Furnisher::wall(double x0, double y0, double x1, double y1, double height) {
  const Vector3d along(x1 - x0, y1 - y0, 0);
  Patch p;
  // Seen from the left of the direction: the viewer's right is against it.
  p.origin = Vector3d(x1, y1, height);
  p.u = -along;
  p.v = Vector3d(0, 0, -height);
  p.look.texture = texture(Material::plaster, 6, along.norm(), height);
  p.shade = lambert_shade(-p.u.cross(p.v).normalized());
  target_->surfaces.patches.push_back(p);
}

void Furnisher::shell(double x0, double y0, double x1, double y1, double height, Material floor) {
  const double w = x1 - x0, d = y1 - y0;
  Patch ground;
  ground.origin = Vector3d(x0, y1, 0);
  ground.u = Vector3d(w, 0, 0);
  ground.v = Vector3d(0, -d, 0);
  ground.look.texture = texture(floor, 1, w, d);
  ground.shade = 0.85F;
  target_->surfaces.patches.push_back(ground);
  Patch ceiling = ground;
  ceiling.origin = Vector3d(x0, y0, height);
  ceiling.v = Vector3d(0, d, 0);
  ceiling.look.texture = texture(Material::plaster, 6, w, d);
  ceiling.shade = 0.92F;
  target_->surfaces.patches.push_back(ceiling);
  for (double x = x0 + 0.8; x + 0.9 < x1; x += 2.1)
    for (double y = y0 + 0.7; y + 0.5 < y1; y += 1.7) {  // lamps and panels
      Surfaces s;
      const int t = texture(Material::drawers, 40, 0.6, 0.4);
      box(&s, Vector3d(x, y, height - 0.06), Vector3d(0.6, 0.4, 0.06), {t, t, t, t, t, -1});
      target_->surfaces.append(s);
    }
  wall(x0, y0, x1, y0, height);
  wall(x1, y0, x1, y1, height);
  wall(x1, y1, x0, y1, height);
  wall(x0, y1, x0, y0, height);
}

void Furnisher::block(double x0, double y0, double x1, double y1, double height) {
  wall(x0, y1, x1, y1, height);
  wall(x1, y1, x1, y0, height);
  wall(x1, y0, x0, y0, height);
  wall(x0, y0, x0, y1, height);
  target_->footprints.push_back({x0, y0, x1, y1});
}

void Furnisher::picture_on_wall(const Rigid3& wall_frame, double x, double z, double width, double height,
                                Material material) {
  Surfaces s;
  const int edge = materials_->get(Material::metal, 1, 0.1, 0.1), t = detail(material, 4096, width, height);
  const double thick = material == Material::poster || material == Material::page ? 0.002 : 0.02;
  box(&s, Vector3d(x, 0, z), Vector3d(width, thick, height), {edge, edge, -1, t, edge, edge});
  add(s, wall_frame);
}

Eigen::Quaterniond Furnisher::leaf_turn(double angle) {
  const double y = random_.uniform(-1, 1);
  return rotation_from_vector(Vector3d(random_.uniform(-1, 1), y, angle));
}

void Furnisher::books(const Rigid3& at, double length, double depth, double height) {
  Surfaces s;
  double x = 0;
  while (true) {
    const double w = random_.uniform(0.018, 0.055), h = height * random_.uniform(0.62, 0.95),
                 d = depth * random_.uniform(0.6, 0.95);
    if (x + w > length) break;
    const bool gap = random_.below(12) == 0;
    if (!gap) {
      const double shift = details_.uniform(-0.02, 0.02);
      const int spine = detail(Material::spine, 96, 0.04, 0.24), side = texture(Material::cover, 12, 0.18, 0.24);
      const int top = materials_->get(Material::page, seed_ % 7, 0.21, 0.05);
      box(&s, Vector3d(x, depth * 0.05, 0), Vector3d(w, d + shift, h), {side, side, -1, spine, -1, top});
    }
    x += w + (gap ? 0.05 : 0.001);
  }
  add(s, at);
}

void Furnisher::shelf(const Rigid3& at, double width, double depth, double height) {
  Surfaces s;
  const int wood = texture(Material::wood, 3, 1.0, 0.3), back = texture(Material::plaster, 6, 1.0, 1.9);
  const double half = width / 2, thick = 0.02;
  box(&s, Vector3d(-half, 0, 0), Vector3d(thick, depth, height), all(wood));
  box(&s, Vector3d(half - thick, 0, 0), Vector3d(thick, depth, height), all(wood));
  box(&s, Vector3d(-half, 0, 0), Vector3d(width, 0.006, height), {-1, -1, -1, back, -1, -1});
  const int boards = std::max(2, static_cast<int>(height / 0.36));
  for (int i = 0; i <= boards; ++i) {
    const double z = (height - thick) * i / boards;
    box(&s, Vector3d(-half, 0, z), Vector3d(width, depth, thick), {-1, -1, -1, wood, wood, wood});
    if (i == boards) break;
    const double room = (height - thick) / boards - thick;
    const Rigid3 row = at * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(-half + thick, 0, z + thick));
    switch (random_.below(5)) {
      case 0: {
        const double split = width * random_.uniform(0.35, 0.6);
        books(row, split, depth, room);
        clutter(row * Rigid3(Eigen::Quaterniond::Identity(), Vector3d((split + width - 2 * thick) / 2, depth / 2, 0)),
                width - 2 * thick - split, depth, Clutter::normal);
        break;
      }
      default:
        books(row, width - 2 * thick, depth, room);
    }
  }
  add(s, at);
  clutter(at * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(0, depth / 2, height)), width, depth, Clutter::normal);
  reserve(at, -half, 0, half, depth);
}

void Furnisher::cabinet(const Rigid3& at, double width, double depth, double height) {
  Surfaces s;
  const int front = texture(Material::drawers, 40, width, height), side = texture(Material::wood, 3, depth, height);
  const int top = texture(Material::wood, 3, width, depth);
  box(&s, Vector3d(-width / 2, 0, 0), Vector3d(width, depth, height), {side, side, side, front, -1, top});
  add(s, at);
  clutter(at * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(0, depth / 2, height)), width, depth, Clutter::normal);
  reserve(at, -width / 2, 0, width / 2, depth);
}

void Furnisher::desk(const Rigid3& at, double width, double depth, Clutter kind) {
  Surfaces s;
  const int top = texture(Material::wood, 3, width, depth), edge = materials_->get(Material::wood, 9, 1.0, 0.1);
  const int leg = materials_->get(Material::metal, 2, 0.1, 0.7);
  const double half = width / 2, height = 0.74;
  box(&s, Vector3d(-half, 0, height - 0.03), Vector3d(width, depth, 0.03), {edge, edge, edge, edge, edge, top});
  for (const double x : {-half + 0.04, half - 0.09})
    for (const double y : {0.04, depth - 0.09})
      box(&s, Vector3d(x, y, 0), Vector3d(0.05, 0.05, height - 0.03), {leg, leg, leg, leg, -1, -1});
  const int drawer = texture(Material::drawers, 40, 0.4, 0.55);
  box(&s, Vector3d(half - 0.5, 0.06, 0.08), Vector3d(0.4, depth - 0.12, 0.55), all(drawer));
  add(s, at);
  clutter(at * Rigid3(Eigen::Quaterniond::Identity(), Vector3d(0, depth / 2, height)), width, depth, kind);
  reserve(at, -half, 0, half, depth);
}

void Furnisher::monitor(const Rigid3& at) {
  Surfaces s;
  const int screen = texture(Material::screen, 9, 0.5, 0.31), body = materials_->get(Material::rubber, 3, 0.5, 0.3);
  box(&s, Vector3d(-0.25, -0.02, 0.12), Vector3d(0.50, 0.04, 0.31), {body, body, body, screen, body, body});
  box(&s, Vector3d(-0.03, -0.05, 0.01), Vector3d(0.06, 0.03, 0.2), all(body));
  tube(&s, Vector3d(0, -0.02, 0), Vector3d(0, -0.02, 0.015), 0.11, body);
  TextureWindow look;
  look.texture = body;
  s.add_disc(Vector3d(0, -0.02, 0.015), Vector3d::UnitZ(), 0.11, look);
  add(s, at);
}

void Furnisher::small_thing(const Rigid3& at, uint32_t kind) {
  Surfaces s;
  const auto disc = [&](const Vector3d& centre, double radius, int t) {
    TextureWindow look;
    look.texture = t;
    s.add_disc(centre, Vector3d::UnitZ(), radius, look);
  };
  switch (kind) {
    case 0: {  // cup
      const int t = detail(Material::carton, 200, 0.25, 0.1), inside = materials_->get(Material::hair, 5, 0.08, 0.08);
      tube(&s, Vector3d(0, 0, 0.1), Vector3d(0, 0, 0), 0.04, t, 0.8);
      disc(Vector3d(0, 0, 0.092), 0.037, inside);
      break;
    }
    case 1: {  // pens in a holder
      const int t = texture(Material::plastic, 8, 0.2, 0.1);
      tube(&s, Vector3d(0, 0, 0), Vector3d(0, 0, 0.1), 0.04, t);
      for (int i = 0; i < 6; ++i) {
        const double a = random_.uniform(0, 6.28), lean = random_.uniform(0.01, 0.035);
        tube(&s, Vector3d(0, 0, 0.02),
             Vector3d(lean * std::cos(a) * 1.6, lean * std::sin(a) * 1.6, random_.uniform(0.13, 0.19)), 0.005,
             texture(Material::plastic, 8, 0.05, 0.15));
      }
      break;
    }
    case 2: {  // bottle
      const int t = detail(Material::carton, 200, 0.2, 0.2), cap = texture(Material::plastic, 8, 0.1, 0.03);
      tube(&s, Vector3d(0, 0, 0), Vector3d(0, 0, 0.17), 0.035, t);
      tube(&s, Vector3d(0, 0, 0.17), Vector3d(0, 0, 0.22), 0.035, t, 0.4);
      tube(&s, Vector3d(0, 0, 0.22), Vector3d(0, 0, 0.24), 0.015, cap);
      disc(Vector3d(0, 0, 0.24), 0.015, cap);
      break;
    }
    case 3: {  // ball
      TextureWindow look;
      look.texture = texture(Material::fabric, 8, 0.35, 0.2);
      s.add_ellipsoid(Vector3d(0, 0, 0.055), Eigen::Matrix3d::Identity(), Vector3d(0.055, 0.055, 0.055), look);
      break;
    }
    case 4: {  // books in a pile
      double z = 0;
      const int n = 1 + static_cast<int>(random_.below(3));
      for (int i = 0; i < n; ++i) {
        const double w = random_.uniform(0.14, 0.2), d = w * 1.35, h = random_.uniform(0.015, 0.05),
                     turn = random_.uniform(-0.3, 0.3);
        const int cover = detail(Material::cover, 64, 0.17, 0.23),
                  page = materials_->get(Material::page, seed_ % 7, 0.21, 0.05);
        const int spine = texture(Material::spine, 96, 0.04, 0.24);
        Surfaces book;
        box(&book, Vector3d(-w / 2, -d / 2, 0), Vector3d(w, d, h), {spine, page, page, page, cover, cover});
        s.append(book.moved(placed(0, 0, z, turn)));
        z += h;
      }
      break;
    }
    case 5: {  // carton
      const double w = random_.uniform(0.08, 0.2), d = random_.uniform(0.06, 0.14), h = random_.uniform(0.06, 0.2);
      const int t = detail(Material::carton, 200, 0.2, 0.15), u = detail(Material::carton, 200, 0.2, 0.15);
      box(&s, Vector3d(-w / 2, -d / 2, 0), Vector3d(w, d, h), {t, u, u, t, -1, u});
      break;
    }
    case 6: {  // small plant
      const int pot = texture(Material::plastic, 8, 0.3, 0.1), leaf = materials_->get(Material::leaves, 1, 0.3, 0.2);
      tube(&s, Vector3d(0, 0, 0), Vector3d(0, 0, 0.09), 0.045, pot, 1.3);
      TextureWindow look;
      look.texture = leaf;
      for (int i = 0; i < 9; ++i) {
        const double a = random_.uniform(0, 6.28), r = random_.uniform(0.01, 0.06);
        const Eigen::Quaterniond q = leaf_turn(a);
        s.add_ellipsoid(Vector3d(r * std::cos(a), r * std::sin(a), 0.1 + random_.uniform(0, 0.1)), q.toRotationMatrix(),
                        Vector3d(0.05, 0.02, 0.008), look);
      }
      break;
    }
    default: {  // telephone-like: two boxes
      const int t = texture(Material::keyboard, 8, 0.2, 0.15);
      box(&s, Vector3d(-0.09, -0.08, 0), Vector3d(0.18, 0.16, 0.04), all(t));
      box(&s, Vector3d(-0.09, -0.08, 0.04), Vector3d(0.05, 0.16, 0.03),
          all(materials_->get(Material::plastic, seed_ % 5, 0.2, 0.2)));
    }
  }
  add(s, at);
}

void Furnisher::clutter(const Rigid3& at, double width, double depth, Clutter height) {
  struct Spot {
    double x, y, r;
  };
  std::vector<Spot> taken;
  const auto free = [&](double x, double y, double r) {
    for (const Spot& t : taken)
      if (std::hypot(x - t.x, y - t.y) < r + t.r) return false;
    return true;
  };
  if (height == Clutter::monitors)
    for (double x = -width / 2 + 0.32; x + 0.3 < width / 2; x += random_.uniform(0.65, 0.9)) {
      if (random_.below(5) == 0) continue;
      const double y = -depth / 2 + 0.16;
      monitor(at * placed(x, y, 0, random_.uniform(-0.25, 0.25)));
      taken.push_back({x, y, 0.2});
      const double ky = y + 0.33;
      Surfaces s;
      const int keys = texture(Material::keyboard, 8, 0.44, 0.15),
                edge = materials_->get(Material::rubber, 3, 0.5, 0.3);
      box(&s, Vector3d(-0.22, -0.075, 0), Vector3d(0.44, 0.15, 0.022), {edge, edge, edge, edge, -1, keys});
      TextureWindow mouse;
      mouse.texture = texture(Material::plastic, 8, 0.15, 0.1);
      s.add_ellipsoid(Vector3d(0.29, 0, 0.01), Eigen::Matrix3d::Identity(), Vector3d(0.03, 0.05, 0.025), mouse);
      add(s, at * placed(x, ky, 0, random_.uniform(-0.15, 0.15)));
      taken.push_back({x - 0.12, ky, 0.14});
      taken.push_back({x + 0.12, ky, 0.16});
    }
  // Pages lie flat, one over the other.
  const int pages = depth < 0.45 ? 0 : static_cast<int>(width * depth * 6);
  for (int i = 0; i < pages; ++i) {
    const double x = random_.uniform(-width / 2 + 0.18, width / 2 - 0.18),
                 y = random_.uniform(-depth / 2 + 0.18, depth / 2 - 0.18);
    Surfaces s;
    const int t = detail(Material::page, 48, 0.21, 0.297);
    box(&s, Vector3d(-0.105, -0.148, 0), Vector3d(0.21, 0.297, 0.0006 + 0.0004 * i), {-1, -1, -1, -1, -1, t});
    add(s, at * placed(x, y, 0, random_.uniform(-3.1, 3.1)));
  }
  const int tries = static_cast<int>(width * depth * 60) + 4;
  for (int i = 0; i < tries; ++i) {
    const uint32_t kind =
        height == Clutter::low ? std::array<uint32_t, 4>{0, 3, 4, 7}[random_.below(4)] : random_.below(8);
    const double r = kind == 4 ? 0.13 : kind == 5 ? 0.11 : kind == 7 ? 0.12 : 0.06, margin = std::min(r, depth * 0.4);
    if (width < 2 * margin + 0.02 || depth < 2 * margin) continue;
    const double x = random_.uniform(-width / 2 + margin, width / 2 - margin),
                 y = random_.uniform(-depth / 2 + margin, depth / 2 - margin);
    const double turn = random_.uniform(-3.1, 3.1), jx = details_.uniform(-0.015, 0.015),
                 jy = details_.uniform(-0.015, 0.015);
    if (!free(x, y, r)) continue;
    taken.push_back({x, y, r});
    small_thing(at * placed(x + jx, y + jy, 0.0005, turn), kind);
  }
  if (depth < 0.45) return;
  for (int i = 0; i < 3; ++i) {  // cables
    Surfaces s;
    const int t = materials_->get(Material::rubber, 4, 0.05, 0.3);
    double x = random_.uniform(-width / 2 + 0.2, width / 2 - 0.2),
           y = random_.uniform(-depth / 2 + 0.15, depth / 2 - 0.15), a = random_.uniform(0, 6.28);
    for (int k = 0; k < 8; ++k) {
      const double x1 = std::clamp(x + 0.05 * std::cos(a), -width / 2, width / 2),
                   y1 = std::clamp(y + 0.05 * std::sin(a), -depth / 2, depth / 2);
      if (std::hypot(x1 - x, y1 - y) > 0.01) tube(&s, Vector3d(x, y, 0.004), Vector3d(x1, y1, 0.004), 0.0035, t);
      x = x1;
      y = y1;
      a += random_.uniform(-0.8, 0.8);
    }
    add(s, at);
  }
}

void Furnisher::plant(const Rigid3& at) {
  Surfaces s;
  const int pot = texture(Material::plastic, 8, 0.8, 0.3), leaf = materials_->get(Material::leaves, 2, 0.4, 0.3),
            stem = materials_->get(Material::wood, 9, 1.0, 0.1);
  tube(&s, Vector3d(0, 0.2, 0), Vector3d(0, 0.2, 0.3), 0.13, pot, 1.25);
  tube(&s, Vector3d(0, 0.2, 0.25), Vector3d(0.02, 0.2, 1.0), 0.02, stem);
  TextureWindow look;
  look.texture = leaf;
  for (int i = 0; i < 34; ++i) {
    const double a = random_.uniform(0, 6.28), r = random_.uniform(0.03, 0.2);
    const Eigen::Quaterniond q = leaf_turn(a);
    s.add_ellipsoid(Vector3d(r * std::cos(a), 0.22 + 0.8 * r * std::sin(a), random_.uniform(0.45, 1.25)),
                    q.toRotationMatrix(), Vector3d(0.12, 0.045, 0.012), look);
  }
  add(s, at);
  reserve(at, -0.22, 0, 0.22, 0.44);
}

void Furnisher::cartons(const Rigid3& at, double width, double depth) {
  Surfaces s;
  double z = 0;
  for (int i = 0; i < 4; ++i) {
    const double w = width * random_.uniform(0.6, 0.98), d = depth * random_.uniform(0.6, 0.98),
                 h = random_.uniform(0.2, 0.4);
    const int t = detail(Material::carton, 200, 0.5, 0.3), u = detail(Material::carton, 200, 0.5, 0.3);
    Surfaces one;
    box(&one, Vector3d(-w / 2, 0.01, 0), Vector3d(w, d, h), {u, t, -1, t, -1, u});
    const double turn = random_.uniform(-0.06, 0.06);
    s.append(one.moved(placed(random_.uniform(-0.02, 0.02), 0, z, turn)));
    z += h;
    if (z > 1.3) break;
  }
  add(s, at);
  reserve(at, -width / 2, 0, width / 2, depth);
}

Surfaces Furnisher::make_chair(Materials* materials, uint64_t seed) {
  Surfaces s;
  const int cloth = materials->get(Material::fabric, seed, 0.5, 0.5),
            metal = materials->get(Material::metal, 4, 0.1, 0.5), black = materials->get(Material::rubber, 5, 0.2, 0.2);
  // A pattern that holds features: the seat's and the back's cushions.
  box(&s, Vector3d(-0.25, -0.25, 0.44), Vector3d(0.5, 0.5, 0.08), all(cloth));
  box(&s, Vector3d(-0.23, -0.27, 0.6), Vector3d(0.46, 0.07, 0.52), all(cloth));
  box(&s, Vector3d(-0.03, -0.27, 0.4), Vector3d(0.06, 0.03, 0.25), all(black));
  tube(&s, Vector3d(0, 0, 0.1), Vector3d(0, 0, 0.44), 0.03, metal);
  for (int i = 0; i < 5; ++i) {
    const double a = 1.2566 * i;
    tube(&s, Vector3d(0, 0, 0.11), Vector3d(0.28 * std::cos(a), 0.28 * std::sin(a), 0.07), 0.022, metal);
    TextureWindow look;
    look.texture = black;
    s.add_ellipsoid(Vector3d(0.28 * std::cos(a), 0.28 * std::sin(a), 0.032), Eigen::Matrix3d::Identity(),
                    Vector3d(0.03, 0.03, 0.032), look);
  }
  for (const double side : {-1.0, 1.0}) {
    tube(&s, Vector3d(side * 0.27, -0.1, 0.48), Vector3d(side * 0.27, -0.05, 0.68), 0.015, black);
    box(&s, Vector3d(side * 0.27 - 0.03, -0.17, 0.68), Vector3d(0.06, 0.28, 0.03), all(black));
  }
  return s;
}

void Furnisher::chair(const Rigid3& at) {
  add(make_chair(materials_, hash64(seed_, random_.below(4))), at);
  reserve(at, -0.33, -0.33, 0.33, 0.33);
}

void Furnisher::line_wall(const Eigen::Vector2d& start, const Eigen::Vector2d& along, double length,
                          double depth_limit) {
  // Wall frame: +x along the wall, +y into the room.
  const Rigid3 frame = placed(start.x(), start.y(), 0, std::atan2(along.y(), along.x()));
  const auto on_wall = [&](double x0, double x1, double z0, double z1) {
    for (double x = x0 + 0.05; x + 0.25 < x1;) {
      const double w = std::min(random_.uniform(0.3, 0.75), x1 - x - 0.04),
                   h = std::min(w * random_.uniform(1.0, 1.45), z1 - z0);
      const Material material = random_.below(3) == 0 ? Material::picture : Material::poster;
      picture_on_wall(frame, x, z0 + random_.uniform(0, std::max(0.0, z1 - z0 - h)), w, h, material);
      x += w + random_.uniform(0.06, 0.25);
    }
  };
  for (double x = random_.uniform(0.08, 0.2); x < length - 0.45;) {
    const double left = length - x;
    double width = 0.5;
    const auto middle = [&] { return frame * placed(x + width / 2, 0.005, 0, 0); };
    // The deeper the room, the more furniture stands among the pictures.
    const uint32_t choice = random_.below(depth_limit < 0.25 ? 6 : depth_limit < 0.5 ? 14 : 18);
    if (choice < 3) {
      width = std::min(left - 0.05, random_.uniform(0.8, 1.4));
      on_wall(x, x + width, 0.35, 1.2);
      on_wall(x, x + width, 1.25, 2.25);
    } else if (choice == 3 && left > 1.7) {
      width = 1.6;
      picture_on_wall(frame, x + 0.05, 1.0, 1.5, 1.0, Material::whiteboard);
      on_wall(x, x + width, 0.2, 0.9);
    } else if (choice == 4 && left > 1.1) {
      width = 1.0;
      picture_on_wall(frame, x + 0.03, 0.0, 0.94, 2.05, Material::door);
    } else if (choice >= 6 && choice <= 10 && left > 1.05) {
      width = random_.uniform(0.8, 1.0);
      shelf(middle(), width, std::min(0.3, depth_limit), random_.uniform(1.5, 2.05));
    } else if (choice >= 11 && choice <= 12 && left > 0.9) {
      width = 0.8;
      const double height = random_.uniform(0.7, 1.25);
      cabinet(middle(), width, std::min(0.4, depth_limit), height);
      on_wall(x, x + width, height + 0.3, 2.3);
    } else if (choice == 13 && left > 0.6) {
      width = 0.55;
      cartons(middle(), width, std::min(0.45, depth_limit));
      on_wall(x, x + width, 1.5, 2.3);
    } else if (choice >= 14 && choice <= 16 && left > 1.5) {
      width = 1.4;
      desk(middle(), width, std::min(0.7, depth_limit), Clutter::monitors);
      on_wall(x, x + width, 1.3, 2.3);
    } else if (choice == 17) {
      plant(middle());
      on_wall(x, x + width, 1.4, 2.3);
    } else {
      on_wall(x, x + width, 0.3, 1.2);
      on_wall(x, x + width, 1.25, 2.25);
    }
    x += width + random_.uniform(0.03, 0.15);
  }
}

}  // namespace dkb::sim
