// SPDX-License-Identifier: Apache-2.0
#include "dkb/matching/optics.h"

#include <algorithm>

namespace dkb {
namespace {

constexpr int kSteps = 64;    // along each edge of the image
constexpr float kMargin = 2;  // [px] more than an undistorted edge bends between two steps

}  // namespace

Optics::Optics(const CameraModel& camera_model, const SensorNoise& sensor_noise, double scale, int pyramid_levels)
    : camera(camera_model), noise(sensor_noise), scale_factor(scale), levels(pyramid_levels) {
  for (size_t octave = 0; octave < variances_.size(); ++octave) {
    const double sigma = pixels(noise.corner_sigma(static_cast<int>(octave), scale_factor));
    variances_[octave] = sigma * sigma;
    scales_[octave] = static_cast<float>(std::pow(scale_factor, octave));
  }
  // The rectangle that none of the edges reaches into, once they are undistorted.
  const double width = camera.width - 1.0, height = camera.height - 1.0;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = width * i / kSteps, y = height * i / kSteps;
    left_ = std::max(left_, static_cast<float>(camera.undistort({0, y}).x()) + kMargin);
    right_ = std::min(right_, static_cast<float>(camera.undistort({width, y}).x()) - kMargin);
    top_ = std::max(top_, static_cast<float>(camera.undistort({x, 0}).y()) + kMargin);
    bottom_ = std::min(bottom_, static_cast<float>(camera.undistort({x, height}).y()) - kMargin);
  }
}

}  // namespace dkb
