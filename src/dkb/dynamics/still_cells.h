// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "dkb/dynamics/silhouette.h"
#include "dkb/image/image.h"

namespace dkb {

// What depth says about standing still, by cells of the image.
struct StillCells {
  enum Kind : uint8_t {
    unknown,    // or it moves
    unrefuted,  // nothing speaks for motion
    witnessed,  // and an earlier view had the surface there, with no mover on it
  };
  int cell = 1;  // [px]
  Image<uint8_t> kinds;
};

// What boxes hold without what stood there before whoever is in them came: of a body only what a view witnessed, beside
// it what nothing speaks against. Nobody knows of cells beyond `still`, which may be empty.
Silhouettes without_still(Silhouettes boxed, const StillCells& still);

}  // namespace dkb
