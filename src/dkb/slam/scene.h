// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "dkb/dynamics/carried_objects.h"
#include "dkb/features/features.h"
#include "dkb/features/frame_features.h"
#include "dkb_slam/frame.h"

namespace dkb {

// A frame with the corners that extraction found.
struct ExtractedFrame {
  FrameIndex index = 0;
  Frame frame;
  OrbFeatures orb;

  const RgbdImage& image() const { return *frame.image(); }
};

// The same, with what is known of movers in it.
struct Scene {
  ExtractedFrame extracted;
  // Per corner: why it must not make map points, if so. Here and nowhere else a feature is rejected because of movers.
  std::vector<FeatureReason> rejected;
  std::vector<Detection> boxes;      // in this image
  std::optional<MotionPrior> step;   // since the frame before: by depth beside what was expected, else a prior's
  MoverMask mask;                    // where movers are (default filter only)
  std::vector<LateMask> late_masks;  // where they were in earlier keyframes, as detections have shown since
};

// The corners that tracking may see. Those that a rival filter rejected are gone for good. Those on movers stay,
// marked: well-established map points may be found there.
struct UsableFeatures {
  OrbFeatures orb;
  std::vector<int> corner;  // per feature: its index among all corners of the scene
  std::vector<FeatureMotion> motion;
};
UsableFeatures usable_features(const Scene& scene);

// What became of every corner in the end. `tracked.source` are indices of `usable`.
std::vector<FeatureReport> report_features(const Scene& scene, const UsableFeatures& usable,
                                           const struct TrackedFrame& tracked);

}  // namespace dkb
