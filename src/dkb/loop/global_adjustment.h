// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/loop/place_verification.h"
#include "dkb/mapping/local_bundle_adjustment.h"
#include "dkb/mapping/map_correction.h"

namespace dkb {

// Adjusts all keyframes and points of a snapshot; the first keyframe of each map stays. `local` tells how points are
// weighted. Deterministic.
MapCorrection adjust_globally(const Map& map, const Optics& optics, const LocalBaOptions& local);

}  // namespace dkb
