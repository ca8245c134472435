// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "dkb/comparison/paper_filter.h"
#include "dkb/detection/detection.h"
#include "dkb/dynamics/mask_filter.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"

namespace dkb {

// Which features move? One family per way that published systems answer it, on the same back end.
enum class FilterKind {
  none,       // nothing is removed
  box,        // every feature in a box of a movable class (as Crowd-SLAM does)
  epipolar,   // features in boxes that leave their epipolar lines (as DS-SLAM and SG-SLAM do)
  multiview,  // features before surfaces that earlier keyframes saw (as DynaSLAM's geometry does)
  paper,      // flow residual and Gaussian depth test in boxes (DKB section 3.1)
  standard,   // silhouettes by depth and motion: our own
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
