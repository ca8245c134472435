// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_camera.h"

#include <algorithm>
#include <cmath>
#include <string_view>

#include "dkb/geometry/camera.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr const char* kRemedy = "; give the camera with --camera FILE";

// Transports hang a name of theirs below the image's.
std::string image_name(std::string topic) {
  for (const char* transport : {"/compressed", "/compressedDepth"})
    if (topic.ends_with(transport)) topic.resize(topic.size() - std::string(transport).size());
  return topic;
}

}  // namespace

Camera camera_of(const CameraInfoMessage& info, bool rectified, const std::string& name) {
  Camera camera;
  camera.width = static_cast<int>(std::min<uint32_t>(info.width, 1 << 20));
  camera.height = static_cast<int>(std::min<uint32_t>(info.height, 1 << 20));
  camera.depth_factor = kMillimetres;
  const bool as_rectified = rectified && info.p[0] != 0;
  if (as_rectified) {
    camera.fx = info.p[0], camera.cx = info.p[2], camera.fy = info.p[5], camera.cy = info.p[6];
  } else {
    camera.fx = info.k[0], camera.cx = info.k[2], camera.fy = info.k[4], camera.cy = info.k[5];
  }
  if (camera.fx == 0) throw InputError(name + ": is of a camera that was not calibrated (focal length 0)" + kRemedy);
  try {
    camera.check();
  } catch (const InvalidOption& e) {
    throw InputError(name + ": " + e.what() + kRemedy);
  }
  try {
    if (!as_rectified) camera.set_distortion(info.distortion_model, info.d);
  } catch (const InputError& e) {
    throw InputError(name + ": " + e.what() + kRemedy + ", or rectified images");
  }
  return camera;
}

bool is_rectified(const std::string& image_topic) {
  const std::string image = image_name(image_topic);
  return image.substr(image.rfind('/') + 1).find("rect") != std::string::npos;
}

std::string info_topic_of(const std::string& image_topic) {
  const std::string image = image_name(image_topic);
  constexpr std::string_view kRealSense = "/image/data";  // librealsense's own bags
  if (image.ends_with(kRealSense)) return image.substr(0, image.size() - kRealSense.size()) + "/info/camera_info";
  return image.substr(0, image.rfind('/') + 1) + "camera_info";
}

bool same_view(const Camera& a, const Camera& b) {
  const auto near = [](double x, double y) { return std::abs(x - y) <= 0.5; };
  return a.width == b.width && a.height == b.height && near(a.fx, b.fx) && near(a.fy, b.fy) && near(a.cx, b.cx) &&
         near(a.cy, b.cy);
}

}  // namespace dkb
