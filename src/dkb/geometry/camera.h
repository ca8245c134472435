// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "dkb/geometry/rigid3.h"
#include "dkb_slam/geometry.h"

namespace dkb {

using CameraModel = Camera;

// [s] The longest readout of a rolling shutter: sensors are read within a frame's time at 30 Hz.
inline constexpr double kMaxReadout = 0.033;

inline constexpr double kMillimetres = 1000;  // [1/m] the depth factor of most cameras but TUM's

// Cameras known by name: fr1, fr2, fr3 (TUM RGB-D), bonn (Bonn RGB-D Dynamic). Nothing for other names. The readout of
// TUM's Kinects, and their depth's time offset, are ours: see docs/decisions.md.
std::optional<CameraModel> builtin_camera(const std::string& name);

// Lengths in an image were chosen by measurement with Kinects of this focal length [px]. What they stand for is an
// angle.
inline constexpr double kUsualFocal = 525;

// [px] What is `usual` pixels for a camera of that focal length.
inline double pixels_of(const CameraModel& camera, double usual) {
  return usual * camera.fx / kUsualFocal;
}

// [px] The side of the square cells in which depth is looked at for what moves: 7.6 mrad, whatever the resolution.
inline int depth_cell(const CameraModel& camera) {
  return std::clamp(static_cast<int>(std::lround(pixels_of(camera, 4))), 2, 32);
}

// [px] Where the image as read shows `point` [m, in the camera]. Nothing where it shows it nowhere: behind the camera,
// and so far aside that the distortion polynomial has turned back and would show it a second time.
std::optional<Eigen::Vector2d> image_pixel(const CameraModel& camera, const Eigen::Vector3d& point);

// The same, and nothing outside the image.
inline std::optional<Eigen::Vector2d> pixel_in_view(const CameraModel& camera, const Eigen::Vector3d& point) {
  const auto at = image_pixel(camera, point);
  const bool inside = at && at->x() >= 0 && at->y() >= 0 && at->x() < camera.width && at->y() < camera.height;
  return inside ? at : std::nullopt;
}

// [px per m, px per rad] How the image of `point` [m, in the camera] moves with a small motion [v, w] of the point
// under the camera: by v + w x point.
inline Eigen::Matrix<double, 2, 6> pixel_by_motion(const CameraModel& camera, const Eigen::Vector3d& point) {
  const double x = point.x(), y = point.y(), z = point.z();
  Eigen::Matrix<double, 2, 3> pixel_by_point;
  pixel_by_point << camera.fx / z, 0, -camera.fx * x / (z * z), 0, camera.fy / z, -camera.fy * y / (z * z);
  Eigen::Matrix<double, 2, 6> jacobian;
  jacobian << pixel_by_point, -pixel_by_point * skew(point);
  return jacobian;
}

}  // namespace dkb
