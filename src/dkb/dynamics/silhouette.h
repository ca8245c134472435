// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "dkb/detection/detection.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/image.h"

namespace dkb {

constexpr int kSilhouetteRim = 1;  // [cells] that they are widened by

// What in each box belongs to the detected object rather than to what is seen beside it.
struct Silhouettes {
  // The nearest depth layer that fills a good part of the box's core, all that hangs together with it in depth within
  // the box, and limbs: surfaces in reach beside it that end within the box. Cells without depth follow their
  // neighbours. A box whose core has no depth at all is taken whole.
  MoverMask mask;
  // The part of it that is surely the object's: what hangs together with the middle of the box and lies nearer to it,
  // along the surfaces, than to what is around the box. A desk at the object's depth goes on beyond the box.
  MoverMask body;
};

Silhouettes silhouettes(const DepthImage& depth, std::span<const Detection> boxes, const Camera& camera,
                        const SensorNoise& noise);

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
