// SPDX-License-Identifier: Apache-2.0
/// \file
/// Rigid motions between coordinate frames, and the camera.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dkb_slam/version.h"

namespace dkb {

template <class T>
class Image;  // of dkb_slam/image.h, whose C++20 users of these types alone need not read: the messages of ROS 1

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Rigid motion between coordinate frames. `b_from_a` maps a point given in frame a to frame b:
///     point_in_b = b_from_a * point_in_a,   c_from_a = c_from_b * b_from_a.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< of unit norm
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();         ///< [m]

  Rigid3() = default;
  Rigid3(const Eigen::Quaterniond& q, const Eigen::Vector3d& t) : rotation(q), translation(t) {}  ///< q of unit norm

  Eigen::Matrix3d matrix3() const { return rotation.toRotationMatrix(); }  ///< of the rotation
  Rigid3 inverse() const {                                                 ///< a_from_b of a b_from_a
    const Eigen::Quaterniond q = rotation.conjugate();
    return {q, -(q * translation)};
  }
  Eigen::Vector3d operator*(const Eigen::Vector3d& point) const { return rotation * point + translation; }
  /// The product is normalised, so that long chains stay rotations.
  Rigid3 operator*(const Rigid3& other) const {
    return {(rotation * other.rotation).normalized(), rotation * other.translation + translation};
  }
};

/// Pinhole camera with distortion (Brown-Conrady, or OpenCV's rational model), and the depth format that comes with it.
/// Camera axes: x right, y down, z forward. The centre of the top-left pixel is (0, 0). Depth is registered to the
/// colour camera.
struct DKB_SLAM_API Camera {
  int width = 640;                        ///< [px] 16 ... 16384
  int height = 480;                       ///< [px] likewise
  double fx = 525.0, fy = 525.0;          ///< [px] > 0
  double cx = 319.5, cy = 239.5;          ///< [px]
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;  ///< radial k, tangential p, in OpenCV's order k1 k2 p1 p2 k3
  double k3 = 0;                          ///< the third radial coefficient
  double k4 = 0, k5 = 0, k6 = 0;          ///< of the rational model: the radial polynomial is divided by theirs
  double depth_factor = 5000.0;           ///< [units per metre] of integer depth images, > 0
  double fps = 0;                         ///< [1/s] nominal frame rate; 0 = as the first five stamps say
  /// [s] of a rolling shutter, from the first row's exposure to the last row's: below 0 where the image is upside down;
  /// 0 = unknown or none.
  double readout = 0.0;
  double depth_time_offset = 0.0;            ///< [s] to add to depth stamps: when the colour camera saw it; 0 = unknown
  double depth_min = 0.2, depth_max = 10.0;  ///< [m] depth outside is taken for missing
  /// Above 0 where every image shows the robot itself, dirt on the lens or writing: no features and no depth are taken
  /// from there. Of the camera's size, or none. Copies of the camera share it; to_yaml() does not tell it.
  std::shared_ptr<const Image<uint8_t>> mask;

  /// A camera that is known by name: fr1, fr2, fr3 (TUM RGB-D), bonn (Bonn RGB-D Dynamic). Throws InputError naming the
  /// nearest one.
  static Camera named(const std::string& name);
  /// Reads a camera file: a YAML map of the fields above; fx, fy, cx, cy, width, height and depth_factor are required,
  /// `mask` is an image file, relative to the camera file's folder.
  /// Or a calibration of ROS or OpenCV, whose depth is in millimetres. Throws InputError with file and line.
  static Camera load(const std::filesystem::path& path);
  /// The camera file's text, every field with its unit; k4, k5, k6 where they are not all 0.
  std::string to_yaml() const;
  /// Throws InvalidOption naming the field.
  void check() const;

  /// Takes the distortion as a CameraInfo of ROS tells it: plumb_bob (k1 k2 p1 p2, and k3), which an empty name stands
  /// for too, or rational_polynomial (k1 k2 p1 p2 k3 k4 k5 k6; zeros may follow). Without coefficients,
  /// or with zeros alone, there is none, whatever the model. Set the other fields first. Throws InputError for other
  /// models, and for a rational one that shows no ray in some part of the image; the camera is as it was then.
  void set_distortion(const std::string& model, const std::vector<double>& coefficients);
  bool rational() const { return k4 != 0 || k5 != 0 || k6 != 0; }  ///< more than Brown-Conrady
  bool distorted() const { return k1 != 0 || k2 != 0 || p1 != 0 || p2 != 0 || k3 != 0 || rational(); }
  /// Ideal (undistorted) pixel of a point in front of the camera; point_in_cam.z() must not be 0.
  Eigen::Vector2d project(const Eigen::Vector3d& point_in_cam) const {
    return {fx * point_in_cam.x() / point_in_cam.z() + cx, fy * point_in_cam.y() / point_in_cam.z() + cy};
  }
  /// Point at depth z [m], along the optical axis, that is seen at an ideal pixel.
  Eigen::Vector3d unproject(const Eigen::Vector2d& pixel, double z) const {
    return {(pixel.x() - cx) / fx * z, (pixel.y() - cy) / fy * z, z};
  }
  Eigen::Vector2d distort(const Eigen::Vector2d& ideal_pixel) const;    ///< ideal to image pixel
  Eigen::Vector2d undistort(const Eigen::Vector2d& image_pixel) const;  ///< image to ideal pixel, by iteration
};

}  // namespace dkb
