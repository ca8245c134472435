// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/comparison/dynamic_filter.h"
#include "dkb/dynamics/carried_objects.h"
#include "dkb/features/features.h"
#include "dkb/features/rgbd_features.h"

namespace dkb {

// What the filters of other systems look at.
struct RivalFilterInput {
  const OrbFeatures& orb;
  const RgbdImage& image;
  const UndistortionTable& undistort;
  const std::vector<Detection>& boxes;
  const PastFrame* previous = nullptr;          // none in the first frame
  const ImagePyramid* pyramid = nullptr;        // of the image, where needs_pyramid()
  Rigid3 current_from_previous;                 // expected motion of the camera
  std::vector<Eigen::Vector3d> seen_in_camera;  // [m] points of earlier keyframes by the expected pose, for `multiview`
};

// The filters that our own is compared with, the paper's among them, each with all it needs. Deterministic.
class RivalFilter {
 public:
  RivalFilter(FilterKind kind, const Camera& camera, const PaperFilterOptions& paper)
      : kind_(kind), camera_(camera), paper_(paper) {}

  bool needs_pyramid() const { return kind_ == FilterKind::paper || kind_ == FilterKind::epipolar; }
  int keyframes_looked_at() const { return kind_ == FilterKind::multiview ? kMultiviewKeyframes : 0; }
  // 1 = dynamic, per corner.
  std::vector<uint8_t> dynamic(const RivalFilterInput& input) const;

 private:
  std::vector<FilterFeature> describe(const RivalFilterInput& input) const;
  Rigid3 own_motion(const std::vector<FilterFeature>& features, const RivalFilterInput& input) const;

  FilterKind kind_;
  Camera camera_;
  PaperFilterOptions paper_;
};

}  // namespace dkb
