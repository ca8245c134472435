// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/absolute_pose.h"

#include <gtest/gtest.h>

#include "dkb/solver/test_world.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

Rigid3 random_pose(Random& random) {
  const Eigen::Vector3d w{random.normal(), random.normal(), random.normal()};
  return {rotation_from_vector(w), {random.uniform(-2, 2), random.uniform(-2, 2), random.uniform(-2, 2)}};
}

TEST(P3p, FindsTheTruePoseAmongAtMostFour) {
  Random random(1);
  constexpr int kTrials = 2000;
  int found = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Rigid3 truth = random_pose(random);
    Eigen::Vector3d points[3], rays[3];
    for (int k = 0; k < 3; ++k) {
      const double z = random.uniform(0.5, 5);
      const Eigen::Vector3d in_cam{z * random.uniform(-0.6, 0.6), z * random.uniform(-0.5, 0.5), z};
      points[k] = truth.inverse() * in_cam;
      rays[k] = in_cam.normalized();
    }
    const std::vector<Rigid3> poses = solve_p3p(points, rays);
    ASSERT_LE(poses.size(), 4u);
    double nearest = 1e9;
    for (const Rigid3& pose : poses) {
      nearest = std::min(nearest, distance(pose, truth));
      // Every answer is a solution: each point lies on its ray, in front.
      for (int k = 0; k < 3; ++k) EXPECT_LT(((pose * points[k]).normalized() - rays[k]).norm(), 1e-5);
    }
    found += nearest < 1e-5;
  }
  EXPECT_GE(found, kTrials - 4);
}

TEST(P3p, RefusesPointsInALine) {
  const Eigen::Vector3d points[3] = {{0, 0, 2}, {0.1, 0, 2}, {0.2, 0, 2}};
  Eigen::Vector3d rays[3];
  for (int k = 0; k < 3; ++k) rays[k] = points[k].normalized();
  EXPECT_TRUE(solve_p3p(points, rays).empty());
  const Eigen::Vector3d same[3] = {points[0], points[0], points[0]};
  EXPECT_TRUE(solve_p3p(same, rays).empty());
}

std::vector<PoseObservation> matches(const CameraModel& camera, const Rigid3& truth, int count, double outliers,
                                     bool depth, std::vector<uint8_t>& outlier, Random& random) {
  std::vector<PoseObservation> observations;
  for (int k = 0; k < count; ++k) {
    PoseObservation o;
    o.pixel = {random.uniform(0, 640), random.uniform(0, 480)};
    const double z = random.uniform(0.8, 4);
    o.point_in_world = truth.inverse() * camera.unproject(o.pixel, z);
    o.pixel += Eigen::Vector2d{random.normal(), random.normal()};
    if (depth) o.depth = z + 0.01 * random.normal();
    outlier.push_back(random.uniform() < outliers);
    if (outlier.back())
      o.point_in_world = truth.inverse() * Eigen::Vector3d{random.normal(), random.normal(), 2 + random.normal()};
    observations.push_back(o);
  }
  return observations;
}

TEST(AbsolutePose, IsFoundAmongHalfOutliers) {
  const CameraModel camera;
  for (const bool depth : {false, true}) {
    for (uint64_t seed = 1; seed <= 10; ++seed) {
      Random random(seed);
      const Rigid3 truth = random_pose(random);
      std::vector<uint8_t> outlier;
      const auto observations = matches(camera, truth, 120, 0.5, depth, outlier, random);
      const RansacPose result = estimate_absolute_pose(camera, observations);
      ASSERT_TRUE(result.ok) << seed;
      EXPECT_LT(distance(result.pose, truth), 0.02) << seed;
      int agree = 0;
      for (size_t i = 0; i < outlier.size(); ++i) agree += outlier[i] != result.inlier[i];
      EXPECT_GT(agree, 105);
      EXPECT_LT(result.iterations, 300);  // confidence stops it: 52 samples for half outliers
    }
  }
}

TEST(AbsolutePose, RandomMatchesAreRefused) {
  const CameraModel camera;
  Random random(3);
  std::vector<uint8_t> outlier;
  const auto observations = matches(camera, Rigid3(), 60, 1.0, true, outlier, random);
  const RansacPose result = estimate_absolute_pose(camera, observations);
  EXPECT_FALSE(result.ok);
  EXPECT_EQ(result.pose.translation, Eigen::Vector3d::Zero());
  EXPECT_FALSE(estimate_absolute_pose(camera, {}).ok);
}

TEST(AbsolutePose, TheSeedDecidesAllRandomness) {
  const CameraModel camera;
  Random random(3);
  std::vector<uint8_t> outlier;
  const auto observations = matches(camera, random_pose(random), 100, 0.4, false, outlier, random);
  const RansacPose a = estimate_absolute_pose(camera, observations, {.seed = 7});
  const RansacPose b = estimate_absolute_pose(camera, observations, {.seed = 7});
  EXPECT_EQ(a.pose.translation, b.pose.translation);
  EXPECT_EQ(a.pose.rotation.coeffs(), b.pose.rotation.coeffs());
  EXPECT_EQ(a.iterations, b.iterations);
}

}  // namespace
}  // namespace dkb
