// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "dkb/detection/detection.h"
#include "dkb/dynamics/mover_mask.h"

namespace dkb {

struct SilhouetteOptions {
  int cell = 4;              // [px] grid on which depth is looked at, 1 ... 32
  double core = 0.5;         // share of the box's width and height around its centre where the object is sought, (0, 1]
  double min_share = 0.2;    // of the core's weight that a depth layer needs to be the object, (0, 1]
  double layer = 0.15;       // [1] half-width of that layer relative to its depth, > 0
  double depth_jump = 0.02;  // [1] depth jump between neighbouring cells of one surface, relative to depth, > 0
  double max_depth_offset = 0.6;  // [m] parts of the object lie at most so far before or behind its layer, > 0
  double margin = 0.05;           // share of the box's size by which it is widened, >= 0
  int rim = 1;                    // [cells] the silhouette is widened by, >= 0
  void check() const;
};

// What in each box belongs to the detected object rather than to what is seen beside it: the nearest depth layer that
// fills a good part of the box's core, all that hangs together with it in depth within the box, and limbs: surfaces in
// reach beside it that end within the box. Cells without depth follow their neighbours. A box whose core has no depth
// at all is taken whole.
MoverMask silhouettes(const DepthImage& depth, std::span<const Detection> boxes, const SilhouetteOptions& options);

}  // namespace dkb
