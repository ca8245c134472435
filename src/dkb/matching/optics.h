// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"

namespace dkb {

// What an image's features are measured with.
struct Optics {
  CameraModel camera;
  SensorNoise noise;
  double scale_factor = 1.2;  // size of a pyramid level over that of the next
  int levels = 8;             // of the pyramid
};

inline double corner_sigma(const Keypoint& feature, const Optics& optics) {
  return corner_sigma(feature, optics.noise, optics.scale_factor);
}

}  // namespace dkb
