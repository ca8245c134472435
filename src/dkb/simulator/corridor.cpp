// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <numbers>

#include "dkb/simulator/interior.h"
#include "dkb/simulator/noise.h"
#include "dkb/simulator/scene.h"

namespace dkb::sim {

using Eigen::Vector2d;
using Eigen::Vector3d;

// 20 m between blank walls: doors and pillars tell how far one has come; a few posters and plants at the start, in the
// middle and at the end are all that has texture.
Scene build_corridor(const SceneRequest& request) {
  Scene scene;
  scene.frames = request.frames > 0 ? request.frames : 900;
  const Footprint area{-1.2, -1.1, 23.6, 1.1};
  const double height = 2.5, recess = 0.12, deep = 0.5;
  scene.inside = area;
  Interior interior(&scene.materials, &scene.furnishing, hash64(request.seed, 0xC0), height);
  Furnisher f(&scene.materials, &scene.furnishing, hash64(request.seed, 0xF00D));
  interior.floor(area, Material::linoleum);
  interior.ceiling(area);

  // Both walls run so that the corridor is on their left.
  const Vector2d right_a(area.x0, area.y0), right_b(area.x1, area.y0), left_a(area.x1, area.y1),
      left_b(area.x0, area.y1);
  const auto right = [&](double x) { return x - area.x0; };
  const auto left = [&](double x) { return area.x1 - x; };
  Random random(hash64(request.seed, 0xD002));
  const auto shifted = [&](double x) { return x + random.uniform(-0.3, 0.3); };
  std::vector<Opening> right_gaps, left_gaps;
  for (const double x : {2.6, 9.9, 20.1}) {
    const double at = shifted(x);
    right_gaps.push_back({right(at), right(at + 0.95)});
  }
  for (const double x : {22.2, 11.5, 1.0}) {
    const double at = shifted(x);
    left_gaps.push_back({left(at + 0.95), left(at)});
  }
  // What tells places apart hangs in niches, which hide it from afar.
  const Opening right_niche{right(12.0), right(13.4), 2.2}, left_niche{left(21.4), left(20.0), 2.2};
  std::vector<Opening> right_all = right_gaps, left_all = left_gaps;
  right_all.insert(right_all.begin() + 2, right_niche);
  left_all.insert(left_all.begin() + 1, left_niche);
  interior.wall(right_a, right_b, right_all);
  interior.wall(left_a, left_b, left_all);
  for (const Opening& o : right_gaps) interior.closed_door(right_a, right_b, o, recess);
  for (const Opening& o : left_gaps) interior.closed_door(left_a, left_b, o, recess);
  interior.niche(right_a, right_b, right_niche, deep);
  interior.niche(left_a, left_b, left_niche, deep);
  for (const double x : {6.2, 14.8}) {
    const double at = shifted(x);
    interior.pillar(right_a, right_b, right(at), right(at + 0.35), 0.14);
  }
  for (const double x : {4.6, 7.8, 16.6}) {
    const double at = shifted(x);
    interior.pillar(left_a, left_b, left(at + 0.35), left(at), 0.14);
  }
  interior.wall({area.x1, area.y0}, {area.x1, area.y1});
  interior.wall({area.x0, area.y1}, {area.x0, area.y0});

  const Rigid3 right_wall = placed(0, area.y0, 0, 0), left_wall = placed(0, area.y1, 0, std::numbers::pi);
  f.picture_on_wall(right_wall, 0.3, 1.0, 0.6, 0.85, Material::poster);
  f.picture_on_wall(right_wall, 1.4, 1.1, 0.5, 0.7, Material::poster);
  f.picture_on_wall(left_wall, -0.7, 1.0, 0.6, 0.8, Material::picture);
  f.picture_on_wall(left_wall, -3.3, 1.0, 0.9, 0.7, Material::poster);
  f.plant(placed(0.2, area.y1 - 0.01, 0, std::numbers::pi));
  f.picture_on_wall(placed(0, area.y0 - deep, 0, 0), 12.6, 0.9, 0.7, 0.9, Material::poster);
  f.plant(placed(12.25, area.y0 - deep, 0, 0));
  f.picture_on_wall(placed(0, area.y1 + deep, 0, std::numbers::pi), -21.2, 1.0, 0.9, 0.8, Material::picture);
  Surfaces mat;  // black: no depth
  const int rubber = scene.materials.get(Material::rubber, 8, 1.2, 1.0);
  mat.add_box({1.3, -0.9, 0}, {1.2, 0, 0}, {0, 1.0, 0}, {0, 0, 0.008}, {rubber, rubber, rubber, rubber, -1, rubber});
  scene.furnishing.surfaces.append(mat);

  const uint64_t seed = hash64(request.seed, 10);
  const double duration = (std::max(scene.frames, 900) - 1) / request.fps;
  scene.path = [seed, duration](double t) {
    const double x = 20 * eased(t / duration, 0.05);
    return shaken({x, 0.15 * std::sin(0.9 * x), 1.15}, 0.2 * std::sin(0.7 * x), -0.07, t, 0.4, seed);
  };
  if (request.people > 0) add_walkers(&scene, WalkArea{}, request.people, scene.frames / request.fps, request);
  return scene;
}

}  // namespace dkb::sim
