// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/depth_registration.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb {
namespace {

Camera camera_of(int width, int height, double focal_length) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = focal_length;
  camera.cx = (width - 1) / 2.0, camera.cy = (height - 1) / 2.0;
  return camera;
}

// Depth of the plane normal * p = distance, pixel by pixel.
DepthImage plane_seen(const Camera& camera, const Rigid3& world_from_cam, const Eigen::Vector3d& normal,
                      double distance) {
  DepthImage depth(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x) {
      const Eigen::Vector3d ray = world_from_cam.rotation * camera.unproject(camera.undistort({x, y}), 1);
      depth(x, y) = static_cast<float>((distance - normal.dot(world_from_cam.translation)) / normal.dot(ray));
    }
  return depth;
}

TEST(DepthRegistration, LeavesDepthOfTheSameViewAsItIs) {
  const Camera camera = camera_of(40, 30, 35);
  const DepthImage depth = plane_seen(camera, {}, Eigen::Vector3d(0.2, 0.1, 1).normalized(), 2);
  EXPECT_EQ(DepthRegistration(camera, camera, {}).registered(depth), depth);
}

// From the side, turned, finer, and both distorted: the plane is where the colour camera would have measured it, up to
// what the slant makes of a pixel, and without gaps where both cameras see it.
TEST(DepthRegistration, GivesAPlaneAsTheColourCameraSeesIt) {
  Camera depth_camera = camera_of(160, 120, 140), colour = camera_of(320, 240, 300);
  depth_camera.k1 = -0.05, colour.k1 = 0.08, colour.p1 = 0.001;
  const Rigid3 colour_from_depth(Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d(0.2, 1, 0).normalized())),
                                 {0.05, 0.01, -0.02});
  const Eigen::Vector3d normal = Eigen::Vector3d(0.3, -0.1, 1).normalized();
  const DepthImage seen = plane_seen(depth_camera, {}, normal, 2);
  const DepthImage truth = plane_seen(colour, colour_from_depth.inverse(), normal, 2);
  const DepthImage depth = DepthRegistration(depth_camera, colour, colour_from_depth).registered(seen);
  int there = 0;
  for (int y = 40; y < 200; ++y)
    for (int x = 60; x < 260; ++x) {
      if (depth(x, y) == 0) continue;
      ++there;
      EXPECT_NEAR(depth(x, y), truth(x, y), 0.02) << x << " " << y;
    }
  EXPECT_GT(there, 0.999 * 160 * 200);
}

TEST(DepthRegistration, TheNearestPointCounts) {
  const Camera camera = camera_of(40, 30, 35);
  DepthImage depth(40, 30, 4.0f);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 20; ++x) depth(x, y) = 1;
  // 0.2 m to the side: near points move by 7 px, far ones by 2.
  const DepthImage registered =
      DepthRegistration(camera, camera, {Eigen::Quaterniond::Identity(), {0.2, 0, 0}}).registered(depth);
  for (int x = 7; x < 27; ++x) EXPECT_EQ(registered(x, 15), 1) << x;
  for (int x = 27; x < 40; ++x) EXPECT_EQ(registered(x, 15), 4) << x;
  EXPECT_EQ(registered(3, 15), 0) << "nobody saw what lies there";
}

TEST(DepthRegistration, DepthBeyondTheCamerasLimitsIsNone) {
  Camera camera = camera_of(40, 30, 35);
  camera.depth_max = 3;
  DepthImage depth(40, 30, 3.5f);
  depth(5, 5) = std::nanf("");
  depth(6, 6) = INFINITY;
  EXPECT_EQ(DepthRegistration(camera, camera, {}).registered(depth), DepthImage(40, 30));
  const Rigid3 nearer(Eigen::Quaterniond::Identity(), {0, 0, -1});
  EXPECT_EQ(DepthRegistration(camera, camera, nearer).registered(depth)(20, 15), 2.5f);
}

TEST(DepthRegistration, DistortionBeyondAllNumbersLeavesPointsOut) {
  const Camera camera = camera_of(40, 30, 35);
  Camera distorted = camera;
  distorted.k1 = 1e300;
  const DepthImage registered = DepthRegistration(camera, distorted, {}).registered(DepthImage(40, 30, 1));
  EXPECT_LE(std::count_if(registered.data(), registered.data() + registered.size(), [](float z) { return z > 0; }), 1);
}

}  // namespace
}  // namespace dkb
