// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/scene.h"

#include "dkb/dynamics/mover_mask.h"
#include "dkb/tracking/frame.h"

namespace dkb {

UsableFeatures usable_features(const Scene& scene) {
  UsableFeatures usable;
  const OrbFeatures& orb = scene.extracted.orb;
  usable.corner.reserve(orb.corners.size());
  usable.motion.reserve(orb.corners.size());
  usable.orb.corners.reserve(orb.corners.size());
  usable.orb.descriptors.reserve(orb.corners.size());
  for (size_t i = 0; i < orb.corners.size(); ++i) {
    if (scene.rejected[i] == FeatureReason::moved) continue;
    const Corner& corner = orb.corners[i];
    usable.corner.push_back(static_cast<int>(i));
    usable.motion.push_back(scene.rejected[i] == FeatureReason::on_mover ? FeatureMotion::on_mover
                                                                         : FeatureMotion::still);
    usable.orb.corners.push_back(corner);
    usable.orb.descriptors.push_back(orb.descriptors[i]);
  }
  return usable;
}

std::vector<FeatureReport> report_features(const Scene& scene, const UsableFeatures& usable,
                                           const TrackedFrame& tracked) {
  const auto& corners = scene.extracted.orb.corners;
  std::vector<FeatureReport> reports(corners.size());
  for (size_t i = 0; i < corners.size(); ++i) {
    const bool dynamic = scene.rejected[i] != FeatureReason::none;
    reports[i] = {corners[i].x, corners[i].y, dynamic ? FeatureState::dynamic : FeatureState::unused,
                  scene.rejected[i]};
  }
  for (size_t f = 0; f < tracked.points.size(); ++f) {
    const size_t feature = tracked.source.empty() ? f : static_cast<size_t>(tracked.source[f]);
    FeatureReport& report = reports[static_cast<size_t>(usable.corner[feature])];
    if (tracked.outlier[f]) {
      if (report.state == FeatureState::unused)
        report.state = FeatureState::outlier, report.reason = FeatureReason::disagrees;
    } else if (tracked.points[f] != kNoPoint || tracked.odometry[f] ||
               (!tracked.makes_point.empty() && tracked.makes_point[f])) {
      report.state = FeatureState::used;
      report.reason = FeatureReason::none;
    }
  }
  return reports;
}

const char* name_of(FeatureState state) {
  static constexpr const char* names[] = {"unused", "used", "outlier", "dynamic"};
  return names[static_cast<size_t>(state)];
}

const char* name_of(FeatureReason reason) {
  static constexpr const char* names[] = {"none", "on_mover", "moved", "disagrees"};
  return names[static_cast<size_t>(reason)];
}

const char* name_of(TrackingState state) {
  static constexpr const char* names[] = {"initialising", "tracking", "lost", "relocalised", "paused", "predicted"};
  return names[static_cast<size_t>(state)];
}

}  // namespace dkb
