// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/recorded_camera.h"

#include <algorithm>
#include <cmath>

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

void set_distortion(const CameraInfoMessage& info, const std::string& name, Camera* camera) {
  const std::string& model = info.distortion_model;
  const bool none = std::all_of(info.d.begin(), info.d.end(), [](double d) { return d == 0; });
  if (none) return;
  const bool plumb_bob = model.empty() || model == "plumb_bob";
  const bool rational =
      model == "rational_polynomial" &&
      std::all_of(info.d.begin() + std::min<std::ptrdiff_t>(5, static_cast<std::ptrdiff_t>(info.d.size())),
                  info.d.end(), [](double d) { return d == 0; });
  if (!plumb_bob && !rational)
    throw InputError(name + ": its distortion model " + model + " is none of ours (plumb_bob)" + kRemedy +
                     ", or rectified images");
  if (info.d.size() < 4 || (plumb_bob && info.d.size() > 5))
    throw InputError(name + ": " + std::to_string(info.d.size()) + " coefficients of distortion, 4 or 5 expected" +
                     kRemedy);
  camera->k1 = info.d[0], camera->k2 = info.d[1], camera->p1 = info.d[2], camera->p2 = info.d[3];
  camera->k3 = info.d.size() > 4 ? info.d[4] : 0;
}

}  // namespace

Camera camera_of(const CameraInfoMessage& info, bool rectified, const std::string& name) {
  Camera camera;
  camera.width = static_cast<int>(std::min<uint32_t>(info.width, 1 << 20));
  camera.height = static_cast<int>(std::min<uint32_t>(info.height, 1 << 20));
  camera.depth_factor = 1000;
  if (rectified && info.p[0] != 0) {
    camera.fx = info.p[0], camera.cx = info.p[2], camera.fy = info.p[5], camera.cy = info.p[6];
  } else {
    camera.fx = info.k[0], camera.cx = info.k[2], camera.fy = info.k[4], camera.cy = info.k[5];
    set_distortion(info, name, &camera);
  }
  if (camera.fx == 0) throw InputError(name + ": is of a camera that was not calibrated (focal length 0)" + kRemedy);
  try {
    camera.check();
  } catch (const InvalidOption& e) {
    throw InputError(name + ": " + e.what() + kRemedy);
  }
  return camera;
}

bool is_rectified(const std::string& image_topic) {
  const std::string image = image_name(image_topic);
  return image.substr(image.rfind('/') + 1).find("rect") != std::string::npos;
}

std::string info_topic_of(const std::string& image_topic) {
  const std::string image = image_name(image_topic);
  return image.substr(0, image.rfind('/') + 1) + "camera_info";
}

bool same_view(const Camera& a, const Camera& b) {
  const auto near = [](double x, double y) { return std::abs(x - y) <= 0.5; };
  return a.width == b.width && a.height == b.height && near(a.fx, b.fx) && near(a.fy, b.fy) && near(a.cx, b.cx) &&
         near(a.cy, b.cy);
}

}  // namespace dkb
