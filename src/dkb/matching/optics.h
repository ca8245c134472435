// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cmath>
#include <limits>

#include "dkb/features/rgbd_features.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"

namespace dkb {

// What an image's features are measured with.
struct Optics {
  Optics(const CameraModel& camera_model = {}, const SensorNoise& sensor_noise = {}, double scale = 1.2,
         int pyramid_levels = 8);

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
  // [px] what is so many pixels for a camera of the usual focal length.
  double pixels(double usual) const { return pixels_of(camera, usual); }
  double corner_sigma(const Keypoint& corner) const { return std::sqrt(corner_variance(corner)); }
  // Whether an ideal pixel lies so far from the edges of the image as read that the lens need not be asked whether it
  // is in view.
  bool well_in_view(float u, float v) const { return u >= left_ && u <= right_ && v >= top_ && v <= bottom_; }

 private:
  std::array<double, SensorNoise::kMaxLevels> variances_;
  std::array<float, SensorNoise::kMaxLevels> scales_;
  static constexpr float kFar = std::numeric_limits<float>::infinity();
  float left_ = -kFar, right_ = kFar, top_ = -kFar, bottom_ = kFar;  // [px]
};

}  // namespace dkb
