// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>

#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"

namespace dkb {

// What an image's features are measured with.
struct Optics {
  Optics(const CameraModel& camera_model = {}, const SensorNoise& sensor_noise = {}, double scale = 1.2,
         int pyramid_levels = 8)
      : camera(camera_model), noise(sensor_noise), scale_factor(scale), levels(pyramid_levels) {
    for (size_t octave = 0; octave < variances_.size(); ++octave) {
      const double sigma = noise.corner_sigma(static_cast<int>(octave), scale_factor);
      variances_[octave] = sigma * sigma;
      scales_[octave] = static_cast<float>(std::pow(scale_factor, octave));
    }
  }

  CameraModel camera;
  SensorNoise noise;
  double scale_factor;  // size of a pyramid level over that of the next
  int levels;           // of the pyramid

  // [px^2, full resolution] of where a corner lies, along each axis: what corners of its level vary by, and what the
  // image's noise leaves of its own.
  double corner_variance(const Keypoint& corner) const {
    const double own = corner.place_sigma;
    return variances_[corner.octave] + own * own;
  }
  // Size of a level over that of the finest.
  float scale(int level) const { return scales_[static_cast<size_t>(level)]; }
  double corner_sigma(const Keypoint& corner) const { return std::sqrt(corner_variance(corner)); }

 private:
  std::array<double, SensorNoise::kMaxLevels> variances_;
  std::array<float, SensorNoise::kMaxLevels> scales_;
};

}  // namespace dkb
