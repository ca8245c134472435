// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "dkb/features/image_pyramid.h"
#include "dkb/features/lucas_kanade.h"
#include "dkb/features/simd.h"

namespace dkb {

// What build() of both frames' pyramids is best given.
inline ImagePyramidOptions flow_pyramid() {
  return {.levels = 4, .scale = 2.0, .min_size = 2 * kFlowWindow};
}

struct FlowResult {
  Eigen::Vector2f position{0, 0};  // [px] in the current image; the last estimate when not found
  bool found = false;
};

// Positions [px, full resolution] of the previous image's `points` in the current image. Both pyramids must be of equal
// size (InputError). Sparse optical flow by pyramidal Lucas-Kanade (Lucas and Kanade, IJCAI 1981; Bouguet 2000): from
// the coarsest level to the finest, the displacement minimises the squared difference of a window,
// [u v]^T = (A^T A)^-1 A^T b (DKB eqs. 1-8), iterated with slopes of the previous image. Levels where the window does
// not fit or is too flat are passed over, the finest excepted. Deterministic and independent of the processor; results
// do not depend on one another.
std::vector<FlowResult> track_flow(const ImagePyramid& previous, const ImagePyramid& current,
                                   std::span<const Eigen::Vector2f> points, Simd simd = best_simd());

}  // namespace dkb
