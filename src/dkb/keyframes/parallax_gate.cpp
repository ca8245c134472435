// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/parallax_gate.h"

#include <algorithm>
#include <cmath>

namespace dkb {
namespace {

constexpr size_t kWindow = 10;                             // [frames] parallaxes averaged (DKB eqs. 17, 18)
constexpr double kRotationMax = 45, kTranslationMax = 10;  // [deg, unit] Theta_max and t_max (DKB eq. 24)
constexpr double kThresholdMin = 10, kThresholdMax = 30;   // [deg + unit] T in fast motion and at rest (DKB eq. 25)

}  // namespace

double units_per_metre(TranslationUnit unit, double median_depth) {
  return unit == TranslationUnit::depth_percent && median_depth > 0 ? 100 / median_depth : 100;
}

Parallax parallax_between(const Rigid3& last_cam_from_world, const Rigid3& cam_from_world, double units_in_metre) {
  const Eigen::Matrix3d rotation = last_cam_from_world.matrix3().transpose() * cam_from_world.matrix3();
  const double cosine = std::clamp((rotation.trace() - 1) / 2, -1.0, 1.0);
  const double metres = (centre_in_world(cam_from_world) - centre_in_world(last_cam_from_world)).norm();
  return {std::acos(cosine) * 180 / M_PI, units_in_metre * metres};
}

double parallax_factor(const Parallax& mean) {
  constexpr double kEpsilon = 1e-5;
  const double sum = mean.sum() + kEpsilon;
  const double w_rotation = mean.rotation_deg / sum, w_translation = mean.translation / sum;
  const double motion = std::log(1 + w_rotation * mean.rotation_deg) + std::log(1 + w_translation * mean.translation);
  const double largest = std::log(1 + w_rotation * kRotationMax) + std::log(1 + w_translation * kTranslationMax);
  return largest < 1e-9 ? 0.0 : std::clamp(motion / largest, 0.0, 1.0);
}

double parallax_threshold(double factor) {
  return kThresholdMax - factor * (kThresholdMax - kThresholdMin);
}

bool ParallaxGate::passes(const Parallax& parallax) {
  window_.push_back(parallax);
  if (window_.size() > kWindow) window_.pop_front();
  factor_ = parallax_factor(mean());
  threshold_ = parallax_threshold(factor_);
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
