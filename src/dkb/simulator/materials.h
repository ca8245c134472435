// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <vector>

#include "dkb/simulator/texture.h"

namespace dkb::sim {

enum class Material {
  plaster,
  planks,
  carpet,
  wood,
  poster,
  picture,
  page,
  cover,
  spine,
  carton,
  keyboard,
  screen,
  fabric,
  denim,
  skin,
  face,
  hair,
  metal,
  plastic,
  rubber,
  door,
  whiteboard,
  drawers,
  leaves,
  paint,     // of a blank wall
  linoleum,  // of a blank floor
  lacquer    // of a plain door
};

// Names as used in scene files, in the order of the enum.
const std::vector<std::string>& material_names();

// Keeps the textures of a scene and paints each when it is first seen. The same material, seed and size give the same
// texture.
class Materials {
 public:
  // Index of the texture of a surface of that size [m].
  int get(Material material, uint64_t seed, double width_m, double height_m);
  // Safe from any thread.
  const Texture& texture(int index) const;

 private:
  struct Entry {
    Material material = Material::plaster;
    uint64_t seed = 0;
    double width_m = 1, height_m = 1;
    mutable std::once_flag painted;
    mutable std::unique_ptr<const Texture> texture;
  };
  std::deque<Entry> entries_;
  std::map<std::tuple<int, uint64_t, int, int>, int> known_;
};

}  // namespace dkb::sim
