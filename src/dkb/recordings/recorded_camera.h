// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "dkb/recordings/ros_messages.h"
#include "dkb_slam/geometry.h"

namespace dkb {

// The camera that a CameraInfo describes: without distortion where the images are rectified. Of models of
// distortion those of Camera::set_distortion() are known. Throws InputError, which begins with `name` and tells
// the remedy, for other models and for cameras that were not calibrated.
Camera camera_of(const CameraInfoMessage& info, bool rectified, const std::string& name);

// Whether a topic's images are rectified, as ROS names them: image_rect, image_rect_color ...
bool is_rectified(const std::string& image_topic);

// The topic of the CameraInfo that belongs to an image topic, by its namespace.
std::string info_topic_of(const std::string& image_topic);

// Same pixels: size and, within half a pixel, focal lengths and principal point.
bool same_view(const Camera& a, const Camera& b);

}  // namespace dkb
