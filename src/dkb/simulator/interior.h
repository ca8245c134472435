// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "dkb/simulator/furniture.h"

namespace dkb::sim {

// A gap in a wall, `from` ... `to` along it, from the floor up to `height` [m].
struct Opening {
  double from = 0, to = 0, height = 2.05;
};

// Blank walls, floors and ceilings in colours close to each other, with their doors and glass: straight lines and
// hardly a corner. What a camera finds here is the geometry.
class Interior {
 public:
  Interior(Materials* materials, Furnishing* target, uint64_t seed, double height)
      : materials_(materials), target_(target), seed_(seed), height_(height) {}

  void floor(const Footprint& area, Material material);
  void ceiling(const Footprint& area);
  // Wall from a to b, seen from its left side. Openings in rising order.
  void wall(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const std::vector<Opening>& openings = {});
  // Wooden frame round an opening of the wall from a to b, on its left side.
  void frame(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Opening& opening);
  // A closed door `depth` behind the wall from a to b, with the reveal around it.
  void closed_door(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Opening& opening, double depth);
  // The same without a door, deep enough to hold something.
  void niche(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Opening& opening, double depth);
  // A blank pillar that stands out of the wall from a to b by `depth`, `from` ... `to` along it.
  void pillar(const Eigen::Vector2d& a, const Eigen::Vector2d& b, double from, double to, double depth);
  // A pane from floor to ceiling on the line a ... b: bars, two printed stripes, and glass that only `glass` holds.
  void pane(const Eigen::Vector2d& a, const Eigen::Vector2d& b, Surfaces* glass);

 private:
  // Wall frame: +x from a to b, +y to its left, z up.
  static Rigid3 frame_of(const Eigen::Vector2d& a, const Eigen::Vector2d& b);
  void face(const Rigid3& frame, double x0, double x1, double z0, double z1, double y, int texture);
  void reveal(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Opening& o, double depth, int side, int back);
  int paint(double width, double height) const { return materials_->get(Material::paint, seed_, width, height); }

  Materials* const materials_;
  Furnishing* const target_;
  const uint64_t seed_;
  const double height_;
};

}  // namespace dkb::sim
