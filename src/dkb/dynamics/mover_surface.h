// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {

// Some points of the surface of a mover as it was seen last. Whoever stands still is no motion any more, but he is
// there until something is seen through where he was.
struct MoverSurface {
  static constexpr size_t kMaxPoints = 64;

  std::vector<Eigen::Vector3d> points_in_world;  // [m]
  double area = 0;                               // [m^2] seen then
  Eigen::Vector3d position_in_world{0, 0, 0};    // [m] median of all of it

  // Whether a depth image shows the surface where it was: half and more of what nothing hides, and enough of it.
  bool stands(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
              const Rigid3& world_from_cam) const;
  // Whether it shows enough of that place, and less than half of the surface there: who hides the place by coming
  // nearer has left it as well.
  bool has_left(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
                const Rigid3& world_from_cam) const;
  // To where the same points are in another world.
  void move(const Rigid3& new_from_old);
  // Bounds [px] of its points in an image.
  Box box_in(const CameraModel& camera, const Rigid3& world_from_cam) const;

 private:
  struct Points {
    int there = 0, beyond = 0, nearer = 0;  // what the sensor tells at their pixels, compared with them
  };
  Points compare(const DepthImage& depth, const CameraModel& camera, const SensorNoise& noise,
                 const Rigid3& world_from_cam) const;
};

}  // namespace dkb
