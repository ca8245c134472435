// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/image.h"
#include "dkb/util/random.h"

namespace dkb {

struct TestPlane {
  Eigen::Vector3d normal;  // of unit length
  double offset;           // normal . x = offset, in the world
};

inline CameraModel plane_test_camera() {
  CameraModel c;
  c.width = 320, c.height = 240;
  c.fx = c.fy = 262;
  c.cx = 159.5, c.cy = 119.5;
  return c;
}

// What a camera sees of planes, each hiding those behind it, with the sensor's noise. `cam_from_world(y)` is where it
// is while row y is read.
template <class Pose>
DepthImage view_by_rows(const std::vector<TestPlane>& planes, const Pose& cam_from_world, uint64_t seed,
                        const CameraModel& c = plane_test_camera()) {
  Random random(seed);
  DepthImage depth(c.width, c.height);
  for (int y = 0; y < c.height; ++y) {
    const Rigid3 world_from_cam = cam_from_world(y).inverse();
    for (int x = 0; x < c.width; ++x) {
      const Eigen::Vector3d ray = world_from_cam.rotation * c.unproject(c.undistort(Eigen::Vector2d(x, y)), 1.0);
      double nearest = 1e9;
      for (const TestPlane& p : planes) {
        const double z = (p.offset - p.normal.dot(world_from_cam.translation)) / p.normal.dot(ray);
        if (z > 0.1 && z < nearest) nearest = z;
      }
      depth(x, y) = static_cast<float>(nearest + SensorNoise().flat_depth_sigma(nearest) * random.normal());
    }
  }
  return depth;
}

// The same of one that is read at once.
inline DepthImage view_of(const std::vector<TestPlane>& planes, const Rigid3& cam_from_world, uint64_t seed,
                          const CameraModel& c = plane_test_camera()) {
  return view_by_rows(
      planes, [&](int) { return cam_from_world; }, seed, c);
}

// Back wall, a wall at an angle on the right, and the floor.
inline std::vector<TestPlane> corner_of_a_room() {
  return {
      {Eigen::Vector3d(0, 0, 1), 3.0}, {Eigen::Vector3d(1, 0, 0.4).normalized(), 1.5}, {Eigen::Vector3d(0, 1, 0), 1.0}};
}

// A camera near the corner of a room that is turned to and fro, with the rows of its depth images read in `readout`
// seconds.
struct TurningCamera {
  Rigid3 cam_from_world(double t) const {
    return {rotation_from_vector({0.25 * std::sin(5 * t), 0.3 * std::cos(4 * t), 0.1 * std::sin(3 * t)}),
            {0.05 * std::sin(3 * t), 0.02 * std::cos(5 * t), 0}};
  }
  DepthImage view(double t, uint64_t seed) const {
    const std::vector<TestPlane> near{{Eigen::Vector3d(0, 0, 1), 1.5},
                                      {Eigen::Vector3d(1, 0, 0.4).normalized(), 0.8},
                                      {Eigen::Vector3d(0, 1, 0), 0.6}};
    return view_by_rows(
        near, [&](int y) { return cam_from_world(time_of_row(t, y)); }, seed);
  }
  double time_of_row(double t, int y) const { return t + readout * ((y + 0.5) / plane_test_camera().height - 0.5); }
  Vector6d velocity(double t) const {  // over the interval before, as a camera in use knows it
    return tangent_from_rigid3(cam_from_world(t) * cam_from_world(t - kInterval).inverse()) / kInterval;
  }

  static constexpr double kInterval = 1 / 30.0;  // [s]
  double readout;
};

}  // namespace dkb
