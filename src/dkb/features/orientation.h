// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "dkb/features/simd.h"

namespace dkb {

inline constexpr int kOrientationRadius = 15;  // [px] of the disc whose intensity centroid gives the orientation

// First moments of the intensity over the disc about a pixel (Rosin, CVIU 1999; Rublee et al., ICCV 2011, section 3.2).
struct CentroidMoments {
  int32_t x = 0, y = 0;
  bool operator==(const CentroidMoments&) const = default;
};

// `centre` points at the pixel, rows are `stride` bytes apart; 16 pixels to each side must exist.
CentroidMoments centroid_moments(const uint8_t* centre, ptrdiff_t stride, Simd simd = best_simd());

// Direction from the centre to the centroid [rad], in [0, 2 pi); x right, y down; 0 for a flat patch.
float orientation_angle(const CentroidMoments& moments);

}  // namespace dkb
