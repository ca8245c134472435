// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/parallax_gate.h"

#include <algorithm>
#include <cmath>

namespace dkb {

double units_per_metre(TranslationUnit unit, double median_depth) {
  switch (unit) {
    case TranslationUnit::metre:
      return 1;
    case TranslationUnit::centimetre:
      return 100;
    case TranslationUnit::depth_percent:
      break;
  }
  return median_depth > 0 ? 100 / median_depth : 100;
}

Parallax parallax_between(const Rigid3& last_cam_from_world, const Rigid3& cam_from_world, double units_in_metre) {
  const Eigen::Matrix3d rotation = last_cam_from_world.matrix3().transpose() * cam_from_world.matrix3();
  const double cosine = std::clamp((rotation.trace() - 1) / 2, -1.0, 1.0);
  const double metres = (centre_in_world(cam_from_world) - centre_in_world(last_cam_from_world)).norm();
  return {std::acos(cosine) * 180 / M_PI, units_in_metre * metres};
}

ParallaxWeights parallax_weights(const Parallax& mean) {
  constexpr double kEpsilon = 1e-5;
  const double sum = mean.sum() + kEpsilon;
  return {mean.rotation_deg / sum, mean.translation / sum};
}

double parallax_factor(const Parallax& mean, double rotation_max, double translation_max) {
  const ParallaxWeights w = parallax_weights(mean);
  const double motion = std::log(1 + w.rotation * mean.rotation_deg) + std::log(1 + w.translation * mean.translation);
  const double largest = std::log(1 + w.rotation * rotation_max) + std::log(1 + w.translation * translation_max);
  return largest < 1e-9 ? 0.0 : std::clamp(motion / largest, 0.0, 1.0);
}

double parallax_threshold(double factor, double threshold_min, double threshold_max) {
  return threshold_max - factor * (threshold_max - threshold_min);
}

ParallaxGate::ParallaxGate(const ParallaxGateOptions& options) : options_(options), threshold_(options.threshold_max) {}

bool ParallaxGate::passes(const Parallax& parallax) {
  window_.push_back(parallax);
  if (static_cast<int>(window_.size()) > options_.window) window_.pop_front();
  factor_ = parallax_factor(mean(), options_.rotation_max, options_.translation_max);
  threshold_ = parallax_threshold(factor_, options_.threshold_min, options_.threshold_max);
  return parallax.sum() >= threshold_;
}

Parallax ParallaxGate::mean() const {
  Parallax sum;
  if (window_.empty()) return sum;
  for (const Parallax& p : window_) {
    sum.rotation_deg += p.rotation_deg;
    sum.translation += p.translation;
  }
  const double n = static_cast<double>(window_.size());
  return {sum.rotation_deg / n, sum.translation / n};
}

}  // namespace dkb
