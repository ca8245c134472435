// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "dkb/geometry/camera.h"
#include "dkb_slam/image.h"

namespace dkb {

// Cameras as ROS' camera_calibration and OpenCV's calibration sample write them in YAML: image_width, image_height,
// camera_matrix, distortion_model (plumb_bob or rational_polynomial; OpenCV writes none) and distortion_coefficients,
// of images that are not rectified. Both know nothing of depth: depth_factor, fps, readout, depth_min, depth_max and
// mask may be added; depth is in millimetres without.
bool is_calibration(const std::string& text);

struct Calibration {
  Camera camera;
  bool depth_assumed = false;  // the file does not say depth_factor
};

// Other keys of such files are passed over, but for misspelt ones. Throws InputError with file and line.
Calibration parse_calibration(const std::string& text, const std::string& name);

// Camera::mask from the image file `value`, relative to the folder of the file `name`, whose line is `where`. Throws
// InputError.
std::shared_ptr<const GreyImage> read_camera_mask(const std::string& value, const std::string& where,
                                                  const std::string& name);

}  // namespace dkb
