// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/depth_alignment.h"

#include <gtest/gtest.h>

#include "dkb/geometry/decompositions.h"
#include "dkb/features/plane_test_scene.h"
#include "dkb/geometry/motion_model.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr double kPositionSd = 0.03, kRotationSd = 0.03;

const std::vector<TestPlane> kCorner = corner_of_a_room();

class DepthAlignmentTest : public testing::Test {
 protected:
  static MotionDepthGrid grid_of(const DepthImage& depth, const MotionRays& rays) {
    MotionDepthGrid grid;
    grid.set_depth(depth, rays);
    std::fill(grid.score.data(), grid.score.data() + grid.score.size(), 0.0f);
    return grid;
  }
  std::optional<MotionPrior> step(const MotionDepthGrid& here, const MotionDepthGrid& there,
                                  const Rigid3& expected = {}) {
    return alignment_.align(here, there, rays_, {expected, false, axis_covariance(kPositionSd, kRotationSd)});
  }
  Rigid3 align(const MotionDepthGrid& here, const MotionDepthGrid& there) {
    const auto found = step(here, there);
    EXPECT_TRUE(found);
    return found ? found->previous_from_current : Rigid3();
  }
  static double degrees(const Rigid3& error) { return vector_from_rotation(error.rotation).norm() * 57.29578; }

  MotionRays rays_{plane_test_camera(), 4};
  DepthAlignment alignment_{SensorNoise(), plane_test_camera().fx, rays_};
  // The camera has come nearer, to the left, and turned by two degrees.
  const Rigid3 moved_{rotation_from_vector({0.01, 0.03, -0.015}), {0.03, -0.01, -0.04}};  // there_from_here
};

TEST_F(DepthAlignmentTest, FindsTheMotionInACorner) {
  const MotionDepthGrid there = grid_of(view_of(kCorner, {}, 1), rays_);
  const MotionDepthGrid here = grid_of(view_of(kCorner, moved_.inverse(), 2), rays_);
  const Rigid3 error = align(here, there) * moved_.inverse();
  EXPECT_LT(error.translation.norm(), 0.01);
  EXPECT_LT(degrees(error), 0.25);
}

TEST_F(DepthAlignmentTest, WhatAWallLeavesOpenStaysAsExpected) {
  const std::vector<TestPlane> wall{{Eigen::Vector3d(0, 0, 1), 2.0}};
  const MotionDepthGrid there = grid_of(view_of(wall, {}, 1), rays_);
  const Rigid3 moved(rotation_from_vector({0.01, 0.02, 0.02}), {0.02, 0.01, 0.03});
  const MotionDepthGrid here = grid_of(view_of(wall, moved.inverse(), 2), rays_);
  const Rigid3 found = align(here, there);
  EXPECT_NEAR(found.translation.z(), 0.03, 0.002);
  EXPECT_NEAR(vector_from_rotation(found.rotation).x(), 0.01, 0.001);
  EXPECT_NEAR(vector_from_rotation(found.rotation).y(), 0.02, 0.001);
  EXPECT_NEAR(vector_from_rotation(found.rotation).z(), 0, 0.003);
  EXPECT_NEAR(found.translation.x(), 0, 0.005);
  EXPECT_NEAR(found.translation.y(), 0, 0.005);
}

// The covariance is that of the step itself: the motion found lies within it of the true one, and what one wall leaves
// open (its own plane) keeps what was expected.
TEST_F(DepthAlignmentTest, TheCovarianceTellsWhatTheSurfacesDoNot) {
  const std::vector<TestPlane> wall{{Eigen::Vector3d(0, 0, 1), 2.0}};
  for (const auto& planes : {wall, kCorner}) {
    double sum = 0;
    const int runs = 10;
    for (int n = 0; n < runs; ++n) {
      const auto seed = static_cast<uint64_t>(2 * n);
      Random random(seed + 100);
      Vector6d off;
      for (int i = 0; i < 6; ++i) off[i] = (i < 3 ? kPositionSd : kRotationSd) * random.normal();
      const MotionDepthGrid there = grid_of(view_of(planes, {}, seed), rays_);
      const MotionDepthGrid here = grid_of(view_of(planes, rigid3_from_tangent(off).inverse(), seed + 1), rays_);
      const auto found = step(here, there);
      ASSERT_TRUE(found);
      const Vector6d error = tangent_from_rigid3(found->previous_from_current.inverse() * rigid3_from_tangent(off));
      sum += error.dot(solve_symmetric(found->covariance, error));
      const Vector6d sd = found->covariance.diagonal().cwiseSqrt();
      if (planes.size() == 1) {
        EXPECT_NEAR(sd[0], kPositionSd, 0.02 * kPositionSd);
        EXPECT_NEAR(sd[5], kRotationSd, 0.02 * kRotationSd);
        EXPECT_LT(sd[2], 0.2 * kPositionSd);
        EXPECT_LT(sd[3], 0.2 * kRotationSd);
      } else {
        EXPECT_LT(sd.maxCoeff(), 0.8 * kPositionSd);
      }
    }
    const double mean = sum / (6 * runs);  // of a chi-squared variable with 60 degrees of freedom, over their number
    EXPECT_LT(mean, 1.5);
    EXPECT_GT(mean, 0.05);
  }
}

// Walls, floor and ceiling tell nothing of the way along them, though the noise of each normal points somewhere.
TEST_F(DepthAlignmentTest, AlongACorridorTheExpectationHolds) {
  const std::vector<TestPlane> corridor{{Eigen::Vector3d(1, 0, 0), 1.2},
                                    {Eigen::Vector3d(-1, 0, 0), 1.2},
                                    {Eigen::Vector3d(0, 1, 0), 1.3},
                                    {Eigen::Vector3d(0, -1, 0), 1.2}};
  const auto view = [&](int n) {
    DepthImage depth = view_of(corridor, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -0.04 * n}), 50 + n);
    for (size_t i = 0; i < depth.size(); ++i)
      if (depth.data()[i] > 5) depth.data()[i] = 0;
    return grid_of(depth, rays_);
  };
  double way = 0;
  MotionDepthGrid there = view(0);
  for (int n = 1; n <= 20; ++n) {
    MotionDepthGrid here = view(n);
    const auto found = step(here, there, Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 0.04}));
    ASSERT_TRUE(found);
    EXPECT_NEAR(std::sqrt(found->covariance(2, 2)), kPositionSd, 0.02 * kPositionSd) << n;
    Vector6d sideways;  // of what lies 3.5 m ahead
    sideways << 1, 0, 0, 0, 3.5, 0;
    EXPECT_LT(std::sqrt(sideways.dot(found->covariance * sideways)), 0.5 * kPositionSd) << n;  // expected to 0.11 m
    way += found->previous_from_current.translation.z();
    there = std::move(here);
  }
  EXPECT_NEAR(way, 0.8, 0.02);
}

// Errors that are the same over 96 pixels, as a calibration's, say more than they are when each cell counts for itself.
TEST_F(DepthAlignmentTest, DistancesThatHangTogetherTellLess) {
  const std::vector<TestPlane> wall{{Eigen::Vector3d(0, 0, 1), 2.0}};
  const auto sd_towards_wall = [&](double common) {
    const MotionDepthGrid there = grid_of(view_of(wall, {}, 1), rays_);
    DepthImage depth = view_of(wall, moved_.inverse(), 2);
    Random random(3);
    float of_block[3][4];
    for (auto& row : of_block)
      for (float& b : row) b = static_cast<float>(common * SensorNoise().flat_depth_sigma(2) * random.normal());
    for (int y = 0; y < depth.height(); ++y)
      for (int x = 0; x < depth.width(); ++x) depth(x, y) += of_block[y / 96][x / 96];
    DepthAlignment alignment(SensorNoise(), plane_test_camera().fx, rays_);
    const auto found = alignment.align(grid_of(depth, rays_), there, rays_,
                                       {moved_, false, axis_covariance(kPositionSd, kRotationSd)});
    return found ? std::sqrt(found->covariance(2, 2)) : 0;
  };
  const double apart = sd_towards_wall(0);
  EXPECT_GT(apart, 0);
  EXPECT_GT(sd_towards_wall(1), 2 * apart);
}

TEST_F(DepthAlignmentTest, SomebodyBeforeAThirdOfTheImageDoesNotPullThePoseAlong) {
  const MotionDepthGrid there = grid_of(view_of(kCorner, {}, 1), rays_);
  DepthImage depth = view_of(kCorner, moved_.inverse(), 2);
  for (int y = 0; y < 240; ++y)
    for (int x = 60; x < 170; ++x) depth(x, y) = 0.8f;
  const Rigid3 error = align(grid_of(depth, rays_), there) * moved_.inverse();
  EXPECT_LT(error.translation.norm(), 0.015);
  EXPECT_LT(degrees(error), 0.25);
}

TEST_F(DepthAlignmentTest, SurfacesThatMovedBeforeAreLeftOut) {
  DepthImage first = view_of(kCorner, {}, 1), second = view_of(kCorner, moved_.inverse(), 2);
  // Nearly half of the image is somebody who goes along with the camera.
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 140; ++x) first(x, y) = second(x, y) = 1.2f + 0.001f * static_cast<float>(x);
  MotionDepthGrid there = grid_of(first, rays_);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 35; ++x) there.score(x, y) = 1;
  const Rigid3 error = align(grid_of(second, rays_), there) * moved_.inverse();
  EXPECT_LT(error.translation.norm(), 0.02);
  EXPECT_LT(degrees(error), 0.3);
}

TEST_F(DepthAlignmentTest, TheReadoutOfARollingShutterIsLearnt) {
  for (const double readout : {-0.015, 0.0, 0.015, 0.03}) {
    const TurningCamera turning{readout};
    DepthAlignment alignment(SensorNoise(), plane_test_camera().fx, rays_);
    EXPECT_EQ(alignment.readout(), 0);
    double squares = 0;
    int frames = 0;
    MotionDepthGrid there;
    for (int n = 0; n < 90; ++n) {
      const double t = n * TurningCamera::kInterval;
      MotionDepthGrid here = grid_of(turning.view(t, 100 + static_cast<uint64_t>(n)), rays_);
      here.time = t;
      here.velocity = turning.velocity(t);
      if (n > 0) {
        const Rigid3 true_step = turning.cam_from_world(there.time) * turning.cam_from_world(t).inverse();
        const Rigid3 expected = rigid3_from_tangent(turning.velocity(there.time) * TurningCamera::kInterval).inverse();
        const auto found =
            alignment.align(here, there, rays_, {expected, false, axis_covariance(kPositionSd, kRotationSd)});
        ASSERT_TRUE(found) << n;
        if (n >= 60) {
          squares += vector_from_rotation((found->previous_from_current * true_step.inverse()).rotation).squaredNorm();
          ++frames;
        }
      }
      there = std::move(here);
    }
    EXPECT_NEAR(alignment.readout(), readout, 0.005);
    EXPECT_LT(std::sqrt(squares / frames), 0.0015) << readout;  // [rad]
  }
}

TEST_F(DepthAlignmentTest, WithoutDepthNothingIsFound) {
  const MotionDepthGrid there = grid_of(view_of(kCorner, {}, 1), rays_);
  EXPECT_FALSE(step(grid_of(DepthImage(320, 240), rays_), there, moved_));
}

}  // namespace
}  // namespace dkb
