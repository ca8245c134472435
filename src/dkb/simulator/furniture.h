// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dkb/geometry/rigid3.h"
#include "dkb/simulator/materials.h"
#include "dkb/simulator/surfaces.h"
#include "dkb/util/random.h"

namespace dkb::sim {

// Axis-aligned ground plan of something that stands in the way [m].
struct Footprint {
  double x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  double distance(double x, double y) const;  // 0 inside
};

// Still things of a scene; z up, floor at z = 0.
struct Furnishing {
  Surfaces surfaces;
  std::vector<Footprint> footprints;
};

// What lies on a desk: nothing higher than 0.15 m, or than 0.3 m, or monitors as well.
enum class Clutter { low, normal, monitors };

// Where an item stands: origin at the floor (or table), +x to its right as seen from behind, +y to its front.
Rigid3 placed(double x, double y, double z, double yaw);

// Builds furniture. The same seed gives the same things. `variation` seeds details apart from the layout: two rooms of
// the same seed and different variations look alike; a fifth of the pictures, books and
// cartons differ, and small things stand a centimetre or two elsewhere.
class Furnisher {
 public:
  Furnisher(Materials* materials, Furnishing* target, uint64_t seed, uint64_t variation = 0);

  // Floor, ceiling and four walls seen from inside.
  void shell(double x0, double y0, double x1, double y1, double height, Material floor);
  // One plain wall face from (x0, y0) to (x1, y1), seen from its left side.
  void wall(double x0, double y0, double x1, double y1, double height);
  // Solid block from floor to `height`.
  void block(double x0, double y0, double x1, double y1, double height);

  // Fills a wall from `start` along the unit vector `along` (the room is on the left) with furniture and pictures.
  // depth_limit [m]: nothing stands out further; below 0.25 only things on the wall.
  void line_wall(const Eigen::Vector2d& start, const Eigen::Vector2d& along, double length, double depth_limit);

  void desk(const Rigid3& at, double width, double depth, Clutter clutter);
  void shelf(const Rigid3& at, double width, double depth, double height);
  void cabinet(const Rigid3& at, double width, double depth, double height);
  void chair(const Rigid3& at);
  void plant(const Rigid3& at);
  void cartons(const Rigid3& at, double width, double depth);
  void picture_on_wall(const Rigid3& wall, double x, double z, double width, double height, Material material);
  // Things lying on a surface of that size whose centre is `at`.
  void clutter(const Rigid3& at, double width, double depth, Clutter kind);

  // An office chair on its own, in its own frame.
  static Surfaces make_chair(Materials* materials, uint64_t seed);

 private:
  int texture(Material material, uint32_t kinds, double width, double height);
  int detail(Material material, uint32_t kinds, double width, double height);
  void add(const Surfaces& local, const Rigid3& at) { target_->surfaces.append(local.moved(at)); }
  void reserve(const Rigid3& at, double x0, double y0, double x1, double y1);
  void monitor(const Rigid3& at);
  void small_thing(const Rigid3& at, uint32_t kind);
  void books(const Rigid3& at, double length, double depth, double height);
  // Of a leaf: anyhow, about the vertical by `angle` [rad] more or less.
  Eigen::Quaterniond leaf_turn(double angle);

  Materials* const materials_;
  Furnishing* const target_;
  const uint64_t seed_, variation_;
  Random random_;   // layout
  Random details_;  // small differences
};

}  // namespace dkb::sim
