// SPDX-License-Identifier: Apache-2.0
// Camera files, ours and calibrations of ROS and OpenCV.
#include <cstdint>
#include <string>

#include "dkb/dataset/camera_file.h"
#include "dkb/util/errors.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  try {
    dkb::parse_camera(std::string(reinterpret_cast<const char*>(data), size), "camera.yaml");
  } catch (const dkb::InputError&) {
  }
  return 0;
}
