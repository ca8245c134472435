// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "dkb/dataset/simulator/texture.h"

namespace dkb::sim {

enum class Material {
  plaster, planks, carpet, wood, poster, picture, page, cover, spine, carton, keyboard, screen, fabric, denim, skin, face,
  hair, metal, plastic, rubber, door, whiteboard, drawers, leaves
};

// Names as used in scene files, in the order of the enum.
const std::vector<std::string>& material_names();

// Paints and keeps the textures of a scene. The same material, seed and size give the same texture.
class Materials {
 public:
  // Index of the texture of a surface of that size [m].
  int get(Material material, uint64_t seed, double width_m, double height_m);
  const Texture& texture(int index) const { return textures_[static_cast<size_t>(index)]; }

 private:
  std::deque<Texture> textures_;
  std::map<std::tuple<int, uint64_t, int, int>, int> known_;
};

}  // namespace dkb::sim
