// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>

namespace dkb {

// What files of a map's own world are named with: nothing for the first map (0), then "_map2" and so on.
inline std::string map_suffix(size_t map) {
  return map == 0 ? "" : "_map" + std::to_string(map + 1);
}

}  // namespace dkb
