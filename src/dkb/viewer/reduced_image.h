// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb_slam/frame.h"

namespace dkb {

// The frame's picture, or its depth (near is bright, black = no data), about 320 px wide as a JPEG. Empty when the
// frame holds none.
std::string reduced_picture(const Frame& frame);
std::string reduced_depth(const Frame& frame);

}  // namespace dkb
