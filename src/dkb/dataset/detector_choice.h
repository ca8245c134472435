// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb_slam/detector.h"

namespace dkb {

// The kinds that DetectorChoice::kinds names, `none` left out; `auto` is `yolo` where there is a model, else `motion`.
// Throws InputError for one that does not exist.
std::vector<std::string> detector_kinds(const std::string& kinds, bool has_model);

}  // namespace dkb
