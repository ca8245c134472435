// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "dkb_slam/geometry.h"

namespace dkb {

using CameraModel = Camera;

// Cameras known by name: fr1, fr2, fr3 (TUM RGB-D), bonn (Bonn RGB-D Dynamic). Nothing for other names. The readout of
// TUM's Kinects is ours: see docs/decisions.md.
std::optional<CameraModel> builtin_camera(const std::string& name);

}  // namespace dkb
