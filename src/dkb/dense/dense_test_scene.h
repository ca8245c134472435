// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <vector>

#include "dkb/dense/depth_view.h"
#include "dkb/dense/tsdf_volume.h"

namespace dkb::testing {

// A room corner seen by cameras with exact depth: a floor at y = 1.2 (y down), a wall at z = 3, a ball, and perhaps a
// person: an upright cylinder that stands in some of the views.
struct DenseScene {
  Eigen::Vector3d ball{0.3, 0.5, 2.0};
  double ball_radius = 0.4;
  std::optional<Eigen::Vector2d> person;  // x, z of the axis
  double person_radius = 0.25;

  // Depth factor along a ray from `eye` with unit z in the camera.
  double hit(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction) const {
    double best = std::numeric_limits<double>::infinity();
    const auto take = [&](double t) {
      if (t > 0.05) best = std::min(best, t);
    };
    if (direction.y() > 1e-9) take((1.2 - eye.y()) / direction.y());
    if (direction.z() > 1e-9) take((3.0 - eye.z()) / direction.z());
    const Eigen::Vector3d m = eye - ball;
    const double a = direction.squaredNorm(), b = m.dot(direction), c = m.squaredNorm() - ball_radius * ball_radius;
    if (b * b > a * c) take((-b - std::sqrt(b * b - a * c)) / a);
    if (person) {
      const Eigen::Vector2d o(eye.x() - person->x(), eye.z() - person->y()), d(direction.x(), direction.z());
      const double pa = d.squaredNorm(), pb = o.dot(d), pc = o.squaredNorm() - person_radius * person_radius;
      if (pb * pb > pa * pc) {
        const double t = (-pb - std::sqrt(pb * pb - pa * pc)) / pa, y = eye.y() + t * direction.y();
        if (y > -0.6 && y < 1.2) take(t);
      }
    }
    return best;
  }

  // Distance of a point to the still surfaces.
  double distance(const Eigen::Vector3d& p) const {
    return std::min({std::abs(1.2 - p.y()), std::abs(3.0 - p.z()), std::abs((p - ball).norm() - ball_radius)});
  }

  RgbdImage draw(const CameraModel& camera, const Rigid3& world_from_cam, double timestamp = 0) const {
    RgbdImage image;
    image.timestamp = image.depth_timestamp = timestamp;
    image.grey = GreyImage(camera.width, camera.height, 120);
    image.colour = ColourImage(camera.width, camera.height, {200, 120, 40});
    image.depth = DepthImage(camera.width, camera.height);
    const Eigen::Matrix3d r = world_from_cam.matrix3();
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const double t = hit(world_from_cam.translation, r * camera.unproject({x, y}, 1));
        if (std::isfinite(t)) image.depth(x, y) = static_cast<float>(t);
      }
    return image;
  }
};

inline CameraModel scene_camera() {
  CameraModel camera;
  camera.width = 160;
  camera.height = 120;
  camera.fx = camera.fy = 130;
  camera.cx = 79.5;
  camera.cy = 59.5;
  return camera;
}

// Steps to the right with a slight turn to the left, looking a little down.
inline Rigid3 scene_pose(int i) {
  return {rotation_from_vector({-0.25, -0.04 * i, 0}), Eigen::Vector3d(0.12 * i - 0.3, 0, 0)};
}

inline DenseOptions scene_options() {
  DenseOptions options;
  options.pixel_step = 1;
  options.voxel = 0.03;
  options.truncation = 0.09;
  return options;
}

}  // namespace dkb::testing
