// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_optimiser.h"

#include <gtest/gtest.h>

#include "dkb/geometry/decompositions.h"
#include "dkb/solver/ceres_test_oracle.h"
#include "dkb/solver/test_world.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

Rigid3 nearby(const Rigid3& pose) {
  return Rigid3(rotation_from_vector({0.02, -0.03, 0.02}), {0.03, 0.02, -0.04}) * pose;
}

TEST(PoseOptimiser, FindsTheExactPoseWithoutNoise) {
  const TestWorld world({.cameras = 1, .pixel_noise = 0, .depth_noise = 1e-9});
  auto observations = world.pose_observations(0);
  for (PoseObservation& o : observations) o.depth_sigma = 0.01;
  const PoseEstimate estimate = optimise_pose(world.problem.camera, nearby(world.cam_from_world[0]), observations);
  ASSERT_TRUE(estimate.ok);
  EXPECT_LT(distance(estimate.cam_from_world, world.cam_from_world[0]), 1e-8);
  EXPECT_EQ(estimate.inliers, static_cast<int>(observations.size()));
}

// What counts little may be off by more, but what it is off by is told by its own sigma.
TEST(PoseOptimiser, WhatCountsLittlePullsTheLessTheWorseItFits) {
  const TestWorld world({.cameras = 1, .pixel_noise = 0.3, .depth_noise = 1e-3});
  const auto error_with = [&](double weight, double sigma) {
    auto observations = world.pose_observations(0);
    for (size_t i = 0; i < observations.size(); ++i) {
      PoseObservation& o = observations[i];
      o.depth = 0;
      o.pixel_sigma = 1;
      if (i % 3 != 0) continue;
      o.pixel.x() += 3;  // within the limit of what weighs a quarter
      o.weight = weight;
      o.pixel_sigma = sigma;
    }
    const PoseEstimate estimate = optimise_pose(world.problem.camera, world.cam_from_world[0], observations);
    EXPECT_TRUE(estimate.ok);
    EXPECT_GT(estimate.inliers, 0.95 * static_cast<double>(observations.size()));
    return distance(estimate.cam_from_world, world.cam_from_world[0]);
  };
  EXPECT_LT(error_with(0.25, 1), 0.9 * error_with(1, 2));
}

TEST(PoseOptimiser, ReachesTheMinimumThatCeresReachesOnItsInliers) {
  int to_the_digit = 0;
  for (uint64_t seed = 1; seed <= 12; ++seed) {
    TestWorld world({.cameras = 1, .fixed = 0, .outlier_share = 0.2, .seed = seed});
    const auto observations = world.pose_observations(0);
    const PoseEstimate estimate = optimise_pose(world.problem.camera, nearby(world.cam_from_world[0]), observations);
    ASSERT_TRUE(estimate.ok);
    BaProblem problem = world.problem;
    problem.points = world.points;
    problem.cam_from_world[0] = nearby(world.cam_from_world[0]);
    std::vector<uint8_t> left_out;
    for (const uint8_t in : estimate.inlier) left_out.push_back(!in);
    // The scale: of the median of what fits, beside 20 observations as given.
    std::vector<double> fits;
    for (size_t i = 0; i < observations.size(); ++i) {
      const PoseObservation& o = observations[i];
      const Eigen::Vector3d p = estimate.cam_from_world * o.point_in_world;
      const double pixel = (world.problem.camera.project(p) - o.pixel).squaredNorm() / (o.pixel_sigma * o.pixel_sigma);
      const double depth = o.depth > 0 ? std::pow((p.z() - o.depth) / o.depth_sigma, 2) : 0;
      if (estimate.inlier[i]) fits.push_back(pixel + depth);
    }
    std::sort(fits.begin(), fits.end());
    const auto n = static_cast<double>(fits.size());
    const double variance = (n * fits[fits.size() / 2] / 1.386 + 20) / (n + 20);
    ceres_bundle_adjust(problem, {.robust = true, .fixed_points = true, .student_variance = variance}, left_out);
    const double apart = distance(estimate.cam_from_world, problem.cam_from_world[0]);
    // A match at the very limit may change sides after the last step; a tenth of the pose's own error then.
    EXPECT_LT(apart, 2e-4) << seed;
    to_the_digit += apart < 1e-5;
  }
  EXPECT_GE(to_the_digit, 10);
}

TEST(PoseOptimiser, TellsOutliersApart) {
  const TestWorld world({.cameras = 1, .outlier_share = 0.35, .seed = 2});
  const auto observations = world.pose_observations(0);
  const PoseEstimate estimate = optimise_pose(world.problem.camera, nearby(world.cam_from_world[0]), observations);
  ASSERT_TRUE(estimate.ok);
  int missed = 0, wrongly = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    missed += world.outlier[i] && estimate.inlier[i];
    wrongly += !world.outlier[i] && !estimate.inlier[i];
  }
  // Outliers of 20 px pass only at the coarsest octave's 3.6 px times 2.45.
  EXPECT_EQ(missed, 0);
  // Noise of 0.7 sigma: P(chi2_2 > 5.991 / 0.49) = 0.2 % without depth; with it 1 sigma in depth adds little.
  EXPECT_LT(wrongly, 0.04 * observations.size());
  EXPECT_LT(distance(estimate.cam_from_world, world.cam_from_world[0]), 0.01);
}

// One match in five is in the row of text beside, within the limit, and all to one side.
TEST(PoseOptimiser, MatchesInTheRowBesideHardlyTakeThePoseAlong) {
  const TestWorld world({.cameras = 1, .points = 300, .pixel_noise = 0.3, .depth_share = 0, .seed = 8});
  auto observations = world.pose_observations(0);
  for (size_t i = 0; i < observations.size(); i += 5) observations[i].pixel.x() += 2.2 * observations[i].pixel_sigma;
  const PoseEstimate estimate = optimise_pose(world.problem.camera, world.cam_from_world[0], observations);
  ASSERT_TRUE(estimate.ok);
  double shift = 0, full = 0;
  for (size_t i = 0; i < observations.size(); ++i) {
    const PoseObservation& o = observations[i];
    const auto seen = [&](const Rigid3& pose) { return world.problem.camera.project(pose * o.point_in_world).x(); };
    shift += seen(estimate.cam_from_world) - seen(world.cam_from_world[0]);
    full += i % 5 == 0 ? 2.2 * o.pixel_sigma : 0;  // what least squares would give
  }
  EXPECT_LT(shift, 0.4 * full);
}

TEST(PoseOptimiser, TailsHardlyMoveTheVarianceOfErrors) {
  std::vector<double> many(1000000, 4 * 1.386);
  EXPECT_NEAR(variance_by_median(many), 4, 1e-3);
  // 20 errors of variance 4 beside the 20 of variance 1; a quarter of them is anything.
  std::vector<double> few(20, 4 * 1.386);
  std::fill(few.begin(), few.begin() + 5, 1e6);
  EXPECT_NEAR(variance_by_median(few), 2.5, 1e-9);
}

TEST(PoseOptimiser, CovarianceEqualsTheSpreadOfEstimates) {
  constexpr int kTrials = 600;
  const TestWorld clean({.cameras = 1, .points = 150, .pixel_noise = 0, .depth_share = 0.5, .seed = 4});
  const auto truth = clean.pose_observations(0);
  const Rigid3& true_pose = clean.cam_from_world[0];
  Random random(11);
  Matrix6d spread = Matrix6d::Zero(), reported = Matrix6d::Zero();
  double mahalanobis = 0;
  for (int trial = 0; trial < kTrials; ++trial) {
    auto observations = truth;
    for (PoseObservation& o : observations) {
      o.pixel += o.pixel_sigma * Eigen::Vector2d{random.normal(), random.normal()};
      if (o.depth > 0) {
        o.depth_sigma = 0.02;
        o.depth = (true_pose * o.point_in_world).z() + o.depth_sigma * random.normal();
      }
    }
    const PoseEstimate estimate = optimise_pose(clean.problem.camera, true_pose, observations);
    ASSERT_TRUE(estimate.ok);
    // world_from_estimate = world_from_true * T(d)
    const Rigid3 d = true_pose * estimate.cam_from_world.inverse();
    Vector6d error;
    error << d.translation, vector_from_rotation(d.rotation);
    spread += error * error.transpose() / kTrials;
    reported += estimate.covariance / kTrials;
    mahalanobis += error.dot(solve_symmetric(estimate.covariance, error)) / kTrials;
  }
  // Relative standard deviation of a variance from 600 samples: sqrt(2 / 600) = 6 %; of the mean of chi2_6: 2.4 %.
  for (int k = 0; k < 6; ++k) EXPECT_NEAR(spread(k, k) / reported(k, k), 1, 0.25) << k;
  EXPECT_NEAR(mahalanobis, 6, 0.6);
}

TEST(PoseOptimiser, APriorActsAsAMeasurement) {
  // Of so little noise that nothing is rejected.
  const TestWorld world({.cameras = 1, .pixel_noise = 0.5, .depth_share = 0, .seed = 6});
  const auto observations = world.pose_observations(0);
  const PoseEstimate free = optimise_pose(world.problem.camera, world.cam_from_world[0], observations);
  const Rigid3& truth = free.cam_from_world;
  Vector6d offset;
  offset << 0.0005, -0.001, 0.0005, 0.0005, 0.00025, -0.0005;
  PosePrior prior;
  prior.cam_from_world = rigid3_from_tangent(offset).inverse() * truth;
  // As much information as the observations have: the estimate lies half way.
  prior.information = inverse(free.covariance);
  const PoseEstimate half = optimise_pose(world.problem.camera, truth, observations, {}, &prior);
  const Rigid3 moved = truth * half.cam_from_world.inverse();
  Vector6d d;
  d << moved.translation, vector_from_rotation(moved.rotation);
  EXPECT_LT((d - 0.5 * offset).norm(), 0.1 * offset.norm());
  EXPECT_LT((2 * half.covariance - free.covariance).norm(), 0.1 * free.covariance.norm());
  // What the observations say is known without the prior all the same.
  ASSERT_TRUE(half.by_observations);
  EXPECT_LT(distance(half.by_observations->cam_from_world, truth), 0.15 * offset.norm());
  EXPECT_LT((half.by_observations->information * free.covariance - Matrix6d::Identity()).norm(), 0.2);
  EXPECT_FALSE(free.by_observations);
  // Overwhelming information: the prior itself.
  prior.information = 1e12 * Matrix6d::Identity();
  const PoseEstimate held = optimise_pose(world.problem.camera, truth, observations, {}, &prior);
  EXPECT_LT(distance(held.cam_from_world, prior.cam_from_world), 1e-5);
}

TEST(PoseOptimiser, DegenerateInputIsNotOkAndStaysFinite) {
  const TestWorld world({.cameras = 1, .seed = 6});
  const Rigid3& truth = world.cam_from_world[0];
  auto observations = world.pose_observations(0);
  const auto expect_refused = [&](const std::vector<PoseObservation>& some) {
    const PoseEstimate estimate = optimise_pose(world.problem.camera, truth, some);
    EXPECT_FALSE(estimate.ok);
    EXPECT_EQ(estimate.cam_from_world.translation, truth.translation);
    EXPECT_EQ(estimate.covariance, Matrix6d::Zero());
    EXPECT_EQ(estimate.inlier.size(), some.size());
  };
  expect_refused({});
  expect_refused({observations.begin(), observations.begin() + 2});
  std::vector<PoseObservation> behind = observations;
  for (PoseObservation& o : behind) o.point_in_world = truth.inverse() * Eigen::Vector3d(0.1, 0.1, -2.0);
  expect_refused(behind);
  // One point again and again leaves a rotation about it.
  expect_refused(std::vector<PoseObservation>(20, observations[0]));
}

TEST(PoseOptimiser, PointsBehindTheCameraAreOutliersAndDoNoHarm) {
  const TestWorld world({.cameras = 1, .seed = 6});
  auto observations = world.pose_observations(0);
  const Rigid3& truth = world.cam_from_world[0];
  const PoseEstimate without = optimise_pose(world.problem.camera, nearby(truth), observations);
  const size_t good = observations.size();
  for (int k = 0; k < 30; ++k) {
    PoseObservation o = observations[k];
    o.point_in_world = truth.inverse() * Eigen::Vector3d(0.1 * k, 0.1, -2.0);
    observations.push_back(o);
  }
  const PoseEstimate with = optimise_pose(world.problem.camera, nearby(truth), observations);
  ASSERT_TRUE(with.ok);
  for (size_t i = good; i < observations.size(); ++i) EXPECT_FALSE(with.inlier[i]);
  EXPECT_LT(distance(with.cam_from_world, without.cam_from_world), 1e-9);
}

TEST(PoseOptimiser, TheSameInputGivesTheSameBits) {
  const TestWorld world({.cameras = 1, .outlier_share = 0.2, .seed = 8});
  const auto observations = world.pose_observations(0);
  const Rigid3 start = nearby(world.cam_from_world[0]);
  const PoseEstimate a = optimise_pose(world.problem.camera, start, observations);
  const PoseEstimate b = optimise_pose(world.problem.camera, start, observations);
  EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
  EXPECT_EQ(a.cam_from_world.rotation.coeffs(), b.cam_from_world.rotation.coeffs());
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.inlier, b.inlier);
}

TEST(PoseOptions, NamesTheFieldThatIsOutOfRange) {
  PoseOptions options;
  options.min_inliers = 2;
  try {
    optimise_pose(CameraModel(), Rigid3(), {}, options);
    FAIL();
  } catch (const InvalidOption& error) {
    EXPECT_NE(std::string(error.what()).find("min_inliers"), std::string::npos);
  }
}

}  // namespace
}  // namespace dkb
