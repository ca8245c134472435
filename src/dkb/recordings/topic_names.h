// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

constexpr const char* kTransforms = "/tf_static";
// A camera file within a recording, as a std_msgs/String, and as a text beside the messages.
constexpr const char* kCameraTopic = "/dkb_slam/camera";
constexpr const char* kCameraText = "dkb_slam_camera";

}  // namespace dkb
