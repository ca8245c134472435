// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

namespace dkb {

// Pinhole camera with Brown-Conrady distortion, and the depth format that comes with it. Camera axes: x right, y down,
// z forward.
struct CameraModel {
  int width = 640, height = 480;                          // [px] 16 ... 16384
  double fx = 525.0, fy = 525.0, cx = 319.5, cy = 239.5;  // [px] fx, fy > 0; centre of the top-left pixel is (0, 0)
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;          // radial k, tangential p (OpenCV's order k1 k2 p1 p2 k3)
  double depth_factor = 5000.0;                           // [units per metre] of integer depth images, > 0
  double fps = 30.0;                                      // [1/s] nominal frame rate, > 0
  double readout = 0.0;  // [s] rolling shutter: from the first row's exposure to the last row's; 0 = global
  double depth_min = 0.2, depth_max = 10.0;  // [m] depth outside is treated as missing

  void check() const;  // throws InvalidOption
  bool distorted() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0; }

  // Ideal (undistorted) pixel of a point in front of the camera; point_in_cam.z() must not be 0.
  Eigen::Vector2d project(const Eigen::Vector3d& point_in_cam) const {
    return {fx * point_in_cam.x() / point_in_cam.z() + cx, fy * point_in_cam.y() / point_in_cam.z() + cy};
  }
  // Point at depth z [m] (along the optical axis) seen at an ideal pixel.
  Eigen::Vector3d unproject(const Eigen::Vector2d& pixel, double z) const {
    return {(pixel.x() - cx) / fx * z, (pixel.y() - cy) / fy * z, z};
  }
  Eigen::Vector2d distort(const Eigen::Vector2d& ideal_pixel) const;    // ideal -> image pixel
  Eigen::Vector2d undistort(const Eigen::Vector2d& image_pixel) const;  // image -> ideal pixel, fixed-point iteration
};

// Cameras known by name: fr1, fr2, fr3 (TUM RGB-D), bonn (Bonn RGB-D Dynamic). Nothing for other names. The readout of
// TUM's Kinects is ours: see docs/decisions.md.
std::optional<CameraModel> builtin_camera(const std::string& name);

}  // namespace dkb
