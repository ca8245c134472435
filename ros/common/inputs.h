// SPDX-License-Identifier: Apache-2.0
// ROS' messages as what the library takes. Each throws dkb::InputError naming the topic and the remedy.
#pragma once

#include <dkb_slam/image.h>

#include "types.h"

namespace dkb_ros {

dkb::ImageView view_of(const ImageMessage& image, bool depth);
// `rectified`: by P, without distortion.
dkb::Camera camera_of(const CameraInfoMessage& info, bool rectified);

}  // namespace dkb_ros
