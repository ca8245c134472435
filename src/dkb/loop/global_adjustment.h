// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/loop/place_verification.h"
#include "dkb/mapping/local_bundle_adjustment.h"
#include "dkb/mapping/map_correction.h"

namespace dkb {

struct GlobalBaOptions {
  int iterations_first = 5;    // [steps] before outliers are told apart, >= 1
  int iterations_second = 10;  // [steps] after, >= 1
  void check() const;
};

// Adjusts all keyframes and points of a snapshot; the first keyframe of each map stays. `local` tells how points are
// weighted. Deterministic.
MapCorrection adjust_globally(const Map& map, const Optics& optics, const LocalBaOptions& local,
                              const GlobalBaOptions& options);

}  // namespace dkb
