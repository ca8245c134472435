// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

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

// Statistics of the depths of one box (DKB eqs. 10, 11 and the text before 12).
struct DepthSpread {
  double mean = 0;      // [m] mu
  double sigma = 0;     // [m]
  double ratio = 0;     // s = sigma_h / sigma_l, about mu; infinity when sigma_l = 0
  double delta = 0;     // eq. 13
  bool usable = false;  // false: fewer than 5 depths or sigma = 0, the test says nothing
};
DepthSpread depth_spread(std::span<const double> depths);

// 1 = dynamic for each depth, by ((d - mu) / sigma)^2 > delta (DKB eqs. 12, 13).
std::vector<uint8_t> depth_test(std::span<const double> depths);

struct PaperFilterOptions {
  double flow_threshold = 1.0;  // [px] d_th of DKB eq. 9, > 0
  bool compensate = true;       // flow against the camera's own motion; false: raw eq. 9, for ablation only
};

// Filters give 1 = dynamic for each feature. The paper's (eqs. 9-13): flow residual against the camera's motion, then
// the depth test on what is left in each box. `current_from_previous`: motion of the camera between the two images.
// Without depth, distance to the epipolar line.
std::vector<uint8_t> paper_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes,
                                  const CameraModel& camera, const Rigid3& current_from_previous,
                                  const PaperFilterOptions& options);

std::vector<uint8_t> epipolar_filter(std::span<const FilterFeature> features, std::span<const Detection> boxes,
                                     const CameraModel& camera, const Rigid3& current_from_previous);

// `seen_in_camera`: points [m] of earlier keyframes in the current camera, by the predicted pose.
constexpr int kMultiviewKeyframes = 5;  // earlier keyframes compared (DynaSLAM, RA-L 2018)
std::vector<uint8_t> multiview_filter(std::span<const FilterFeature> features,
                                      std::span<const Eigen::Vector3d> seen_in_camera, const CameraModel& camera,
                                      const DepthImage& depth);

}  // namespace dkb
