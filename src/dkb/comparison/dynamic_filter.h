// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/comparison/paper_filter.h"
#include "dkb/detection/detection.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb_slam/options.h"

namespace dkb {

// A corner of the current image, with what flow and depth tell of it.
struct FilterFeature {
  Eigen::Vector2d image_pixel;     // [px] as read
  Eigen::Vector2d pixel;           // [px] ideal
  double depth = 0;                // [m] 0 = unknown
  bool flowed = false;             // the two below are known
  Eigen::Vector2d previous_pixel;  // [px] ideal, the same point in the previous image
  double previous_depth = 0;       // [m] there; 0 = unknown
};

// Index of the smallest box that holds each feature, -1 = none.
std::vector<int> box_of_each(std::span<const FilterFeature> features, std::span<const Detection> boxes);

// 1 = dynamic, per feature.
std::vector<uint8_t> box_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes);

// The paper's filter (eqs. 9-13): flow residual against the camera's motion, then the depth test on what is left in
// each box. `current_from_previous`: motion of the camera between the two images. Without depth, distance to the
// epipolar line.
std::vector<uint8_t> paper_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes,
                                  const CameraModel& camera, const Rigid3& current_from_previous,
                                  const PaperFilterOptions& options);

struct EpipolarFilterOptions {
  double threshold = 1.0;  // [px] distance to the epipolar line, > 0
  void check() const { require_option(threshold > 0, "threshold", threshold, "greater than 0 px"); }
};
std::vector<uint8_t> epipolar_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes,
                                     const CameraModel& camera, const Rigid3& current_from_previous,
                                     const EpipolarFilterOptions& options);

struct MultiviewFilterOptions {
  double depth_jump = 0.4;  // [m] a surface must lie so far before what was seen there, > 0 (DynaSLAM, RA-L 2018)
  double radius = 15;       // [px] features so near to such a spot and at its depth are dynamic too, > 0
  int keyframes = 5;        // earlier keyframes compared, >= 1 (the same source)
  void check() const {
    require_option(depth_jump > 0, "depth_jump", depth_jump, "greater than 0 m");
    require_option(radius > 0, "radius", radius, "greater than 0 px");
    require_option(keyframes >= 1, "keyframes", keyframes, "at least 1");
  }
};
// `seen_in_camera`: points [m] of earlier keyframes in the current camera, by the predicted pose.
std::vector<uint8_t> multiview_filter(std::span<const FilterFeature> features,
                                      std::span<const Eigen::Vector3d> seen_in_camera, const CameraModel& camera,
                                      const DepthImage& depth, const MultiviewFilterOptions& options);

}  // namespace dkb
