// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/motion_depth_grid.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb {
namespace {

TEST(MotionRays, ProjectEveryCellOntoItselfUnderNoMotion) {
  for (const char* name : {"fr1", "fr2", "fr3"}) {
    const CameraModel camera = *builtin_camera(name);
    const MotionRays rays(camera, 4);
    MotionProjection projection;
    rays.project(Image<float>(rays.width(), rays.height(), 2.0f), 1.0f, Rigid3(), rays.all_cells(), projection);
    for (size_t i = 0; i < projection.cell.size(); ++i) {
      ASSERT_EQ(projection.cell[i], static_cast<int32_t>(i)) << name;
      ASSERT_EQ(projection.depth[i], 2.0f);
    }
  }
}

void expect_agreement(const CameraModel& camera) {
  const MotionRays rays(camera, 4);
  const Rigid3 motion(rotation_from_vector({0.05, -0.1, 0.2}), {0.1, -0.05, -0.3});
  const Image<float> depth(rays.width(), rays.height(), 1.5f);
  MotionProjection projection;
  rays.project(depth, 1.0f, motion, rays.all_cells(), projection);
  int seen = 0, different = 0;
  for (int y = 0; y < rays.height(); ++y)
    for (int x = 0; x < rays.width(); ++x) {
      const int cell = projection.cell[static_cast<size_t>(y * rays.width() + x)];
      if (cell < 0) continue;
      const Eigen::Vector2d pixel = camera.undistort({4 * x + 1.5, 4 * y + 1.5});
      const Eigen::Vector2d there = camera.distort(camera.project(motion * camera.unproject(pixel, 1.5)));
      const int expected_x = static_cast<int>(std::floor((there.x() + 0.5) / 4));
      const int expected_y = static_cast<int>(std::floor((there.y() + 0.5) / 4));
      ++seen;
      different += cell != expected_y * rays.width() + expected_x;
    }
  EXPECT_GT(seen, 10000);
  EXPECT_LT(different, 10);  // positions on the very edge between two cells
}

TEST(MotionRays, AgreeWithTheCameraModel) {
  CameraModel rational;
  rational.fx = rational.fy = 303;
  rational.set_distortion("rational_polynomial", {0.5, -2.6, 0.0007, -0.0002, 1.5, 0.38, -2.45, 1.43});
  expect_agreement(*builtin_camera("fr1"));
  expect_agreement(rational);
}

// A point that is read in one row of the one image and in another row of the other, each while its camera moves.
TEST(MotionRays, FollowPointsFromOneReadoutToAnother) {
  const CameraModel camera = *builtin_camera("fr1");
  const MotionRays rays(camera, 4);
  const Rigid3 motion(rotation_from_vector({0.05, -0.1, 0.1}), {0.1, -0.05, -0.2});
  Vector6d velocity_here, velocity_there;
  velocity_here << 0.3, -0.2, 0.4, 1.5, -0.8, 0.7;
  velocity_there << -0.2, 0.3, 0.1, -0.9, 1.2, -0.5;
  const double readout = 0.03;
  const Image<float> depth(rays.width(), rays.height(), 1.5f);
  MotionProjection projection;
  rays.project(depth, 1.0f, motion, rays.all_cells(), projection, best_simd(), {velocity_here, readout},
               {velocity_there, readout});
  int seen = 0, different = 0;
  for (int y = 0; y < rays.height(); ++y)
    for (int x = 0; x < rays.width(); ++x) {
      const size_t i = static_cast<size_t>(y * rays.width() + x);
      const Eigen::Vector3d at_row = 1.5 * camera.unproject(camera.undistort({4 * x + 1.5, 4 * y + 1.5}), 1.0);
      const double late_here = readout * ((y + 0.5) / rays.height() - 0.5);
      const Eigen::Vector3d middle = motion * (rigid3_from_tangent(velocity_here * late_here).inverse() * at_row);
      // The row that sees it, by iteration.
      Eigen::Vector3d there = middle;
      Eigen::Vector2d pixel = camera.distort(camera.project(there));
      for (int n = 0; n < 20; ++n) {
        const double late = readout * std::clamp((pixel.y() + 0.5) / camera.height - 0.5, -0.5, 0.5);
        there = rigid3_from_tangent(velocity_there * late) * middle;
        pixel = camera.distort(camera.project(there));
      }
      int u = -1, v = -1;
      const bool found = rays.find_cell(
          (motion.matrix3() * rays.point(x, y, 1.5f, {velocity_here, readout}).cast<double>() + motion.translation)
              .cast<float>(),
          &u, &v, {velocity_there, readout});
      ASSERT_EQ(found, projection.cell[i] >= 0);
      if (!found) continue;
      ++seen;
      ASSERT_LE(std::abs(v * rays.width() + u - projection.cell[i]) % rays.width(), 1);
      const double right = (pixel.x() + 0.5) / 4 - 0.5 - u, down = (pixel.y() + 0.5) / 4 - 0.5 - v;
      different += std::max(std::abs(right), std::abs(down)) > 0.65;
      ASSERT_LT(std::max(std::abs(right), std::abs(down)), 1.25) << x << " " << y;  // rows without the lens
      EXPECT_NEAR(projection.depth[i], there.z(), 0.004);  // to first order
    }
  EXPECT_GT(seen, 10000);
  EXPECT_LT(different, seen / 50);
}

TEST(MotionRays, SeeNothingBehindTheCamera) {
  const MotionRays rays(*builtin_camera("fr3"), 4);
  MotionProjection projection;
  rays.project(Image<float>(160, 120, 1.0f), 1.0f, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -1.5}),
               rays.all_cells(), projection);
  for (int32_t cell : projection.cell) ASSERT_EQ(cell, -1);
}

TEST(MotionDepthGrid, TakesTheLowerMedianAndTheBoundsOfItsNeighbourhood) {
  const MotionRays rays(*builtin_camera("fr3"), 4);
  DepthImage image(640, 480, 2.0f);
  for (int y = 40; y < 80; ++y)
    for (int x = 40; x < 80; ++x) image(x, y) = 1.0f;  // cells 10 ... 19
  for (int y = 200; y < 240; ++y)
    for (int x = 200; x < 240; ++x) image(x, y) = 0.0f;  // cells 50 ... 59
  MotionDepthGrid grid;
  grid.set_depth(image, rays);
  EXPECT_EQ(grid.depth(15, 15), 1.0f);
  EXPECT_EQ(grid.nearest(15, 15), 1.0f);
  EXPECT_EQ(grid.farthest(15, 15), 1.0f);
  EXPECT_EQ(grid.depth(9, 15), 2.0f);
  EXPECT_EQ(grid.nearest(9, 15), 1.0f);  // its right neighbour is nearer
  EXPECT_EQ(grid.nearest(8, 15), 2.0f);
  EXPECT_EQ(grid.farthest(19, 15), 2.0f);  // its right neighbour is farther
  EXPECT_EQ(grid.depth(55, 55), 0.0f);
  EXPECT_EQ(grid.farthest(55, 55), 0.0f);
  EXPECT_TRUE(std::isinf(grid.nearest(55, 55)));
  EXPECT_EQ(grid.nearest(50, 55), 2.0f);  // missing depth bounds nothing
}

TEST(MotionDepthGrid, CoversImagesThatAreNoMultipleOfTheCell) {
  CameraModel camera;
  camera.width = 101;
  camera.height = 67;
  const MotionRays rays(camera, 8);
  EXPECT_EQ(rays.width(), 13);
  EXPECT_EQ(rays.height(), 9);
  MotionDepthGrid grid;
  grid.set_depth(DepthImage(101, 67, 1.5f), rays);
  for (size_t i = 0; i < grid.depth.size(); ++i) EXPECT_EQ(grid.depth.data()[i], 1.5f);
}

}  // namespace
}  // namespace dkb
