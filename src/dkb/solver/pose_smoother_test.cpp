// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/pose_smoother.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <random>

namespace dkb {
namespace {

constexpr double kStepTime = 1.0 / 30;  // [s]

// A camera that sways as in a hand, within a few tenths of a metre and radian.
Rigid3 true_pose(double t) {
  return {rotation_from_vector({0.2 * std::sin(0.9 * t), 0.3 * std::sin(1.3 * t + 1), 0.1 * std::sin(2.1 * t)}),
          {0.3 * std::sin(1.1 * t), 0.2 * std::sin(1.7 * t + 2), 0.25 * std::sin(0.7 * t + 1)}};
}

std::vector<MeasuredPose> measured(int n, double sd_m, double sd_rad, double claimed = 1, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Vector6d sd;
  sd << Eigen::Vector3d::Constant(sd_m), Eigen::Vector3d::Constant(sd_rad);
  std::vector<MeasuredPose> poses;
  for (int k = 0; k < n; ++k) {
    Vector6d d;
    for (int i = 0; i < 6; ++i) d[i] = sd[i] * normal(random);
    const Vector6d variance = (claimed * sd).cwiseAbs2();
    poses.push_back({k * kStepTime, true_pose(k * kStepTime) * rigid3_from_tangent(d), variance.asDiagonal()});
  }
  return poses;
}

struct Errors {
  double m = 0, rad = 0;  // root mean squares
};
Errors errors(const std::vector<MeasuredPose>& at, const std::vector<Rigid3>& poses) {
  Errors e;
  for (size_t k = 0; k < poses.size(); ++k) {
    const Vector6d d = tangent_from_rigid3(true_pose(at[k].time).inverse() * poses[k]);
    e.m += d.head<3>().squaredNorm() / static_cast<double>(poses.size());
    e.rad += d.tail<3>().squaredNorm() / static_cast<double>(poses.size());
  }
  return {std::sqrt(e.m), std::sqrt(e.rad)};
}
std::vector<Rigid3> as_measured(const std::vector<MeasuredPose>& measured) {
  std::vector<Rigid3> poses;
  for (const MeasuredPose& p : measured) poses.push_back(p.world_from_cam);
  return poses;
}

TEST(PoseSmoother, HalvesIndependentErrors) {
  const auto noisy = measured(300, 0.004, 0.003);
  const Errors before = errors(noisy, as_measured(noisy)), after = errors(noisy, smoothed_poses(noisy));
  EXPECT_LT(after.m, 0.55 * before.m);
  EXPECT_LT(after.rad, 0.55 * before.rad);
}

TEST(PoseSmoother, LearnsThatCovariancesClaimTooLittle) {
  const auto honest = measured(300, 0.004, 0.003), boasting = measured(300, 0.004, 0.003, 0.1);
  const double expected = errors(honest, smoothed_poses(honest)).m;
  EXPECT_NEAR(errors(boasting, smoothed_poses(boasting, {}, 20)).m, expected, 0.1 * expected);
}

TEST(PoseSmoother, LeavesExactPosesWhereTheyAre) {
  const auto exact = measured(100, 0, 0);
  std::vector<MeasuredPose> poses = exact;
  for (MeasuredPose& p : poses) p.covariance = Matrix6d::Identity() * 1e-6;
  const Errors e = errors(exact, smoothed_poses(poses));
  EXPECT_LT(e.m, 2e-4);  // what the motion itself has beyond a constant speed
  EXPECT_LT(e.rad, 2e-4);
}

// The same least squares as one dense system, for a camera that does not turn and for given noise.
TEST(PoseSmoother, IsTheLeastSquaresSolution) {
  constexpr int kPoses = 12;
  const MotionNoise noise{0.2, 0.3, 2};
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  std::vector<MeasuredPose> poses;
  for (int k = 0; k < kPoses; ++k) {
    const double sd = k % 3 == 0 ? 0.02 : 0.005;
    poses.push_back({0.03 * k + 0.01 * (k % 2),
                     {Eigen::Quaterniond::Identity(), {0.1 * k + sd * normal(random), sd * normal(random), 0}},
                     Matrix6d::Identity() * (sd * sd)});
  }
  // Unknowns of one axis: position and velocity of each pose.
  for (int axis = 0; axis < 2; ++axis) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(2 * kPoses, 2 * kPoses);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(2 * kPoses);
    // What is assumed at first: 1 m about the first pose, 1 m/s.
    information(0, 0) += 1;
    right(0) += poses[0].world_from_cam.translation[axis];
    information(1, 1) += 1;
    for (int k = 0; k < kPoses; ++k) {
      const MeasuredPose& p = poses[static_cast<size_t>(k)];
      const double w = 1 / (noise.measurement * p.covariance(0, 0));
      information(2 * k, 2 * k) += w;
      right(2 * k) += w * p.world_from_cam.translation[axis];
      if (k == 0) continue;
      const double dt = p.time - poses[static_cast<size_t>(k - 1)].time;
      Eigen::Matrix2d q;
      q << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt;
      Eigen::Matrix<double, 2, 4> jacobian;
      jacobian << -1, -dt, 1, 0, 0, -1, 0, 1;
      information.block<4, 4>(2 * (k - 1), 2 * (k - 1)) +=
          jacobian.transpose() * (noise.acceleration * q).inverse() * jacobian;
    }
    const Eigen::VectorXd expected = information.ldlt().solve(right);
    const std::vector<Rigid3> smoothed = smoothed_poses(poses, noise, 1);
    for (int k = 0; k < kPoses; ++k)
      EXPECT_NEAR(smoothed[static_cast<size_t>(k)].translation[axis], expected[2 * k], 1e-9) << k;
  }
}

TEST(PoseSmoother, APoseMayBeMuchLessCertainThanOthers) {
  auto poses = measured(100, 0.002, 0.002);
  for (size_t k = 40; k < 50; ++k) {  // a third of a second in which hardly anything was seen
    poses[k].world_from_cam.translation += Eigen::Vector3d(0.05, -0.05, 0.05);
    poses[k].covariance *= 10000;
  }
  const auto smoothed = smoothed_poses(poses);
  for (size_t k = 40; k < 50; ++k)
    EXPECT_LT((smoothed[k].translation - true_pose(poses[k].time).translation).norm(), 0.02) << k;
}

TEST(PoseSmoother, NothingReachesAcrossAGap) {
  auto poses = measured(60, 0.003, 0.003);
  std::vector<MeasuredPose> first(poses.begin(), poses.begin() + 30), second(poses.begin() + 30, poses.end());
  for (size_t k = 30; k < 60; ++k) poses[k].time += 5;
  const auto together = smoothed_poses(poses), a = smoothed_poses(first), b = smoothed_poses(second);
  for (size_t k = 0; k < 30; ++k) {
    EXPECT_EQ(together[k].translation, a[k].translation);
    EXPECT_LT((together[k + 30].translation - b[k].translation).norm(), 1e-9);
  }
}

TEST(PoseSmoother, LongSequencesHaveNoSeams) {
  // Parts have 512 poses; every one is smoothed by its neighbours on both sides.
  const auto noisy = measured(1100, 0.004, 0.003);
  const auto smoothed = smoothed_poses(noisy);
  ASSERT_EQ(smoothed.size(), noisy.size());
  const auto error = [&](size_t k) { return (smoothed[k].translation - true_pose(noisy[k].time).translation).norm(); };
  double all = 0, seams = 0;
  for (size_t k = 0; k < smoothed.size(); ++k) all += error(k) / static_cast<double>(smoothed.size());
  for (const size_t seam : {size_t{512}, size_t{1024}})
    for (size_t k = seam - 5; k < seam + 5; ++k) seams += error(k) / 20;
  EXPECT_LT(seams, 1.5 * all);
}

TEST(PoseSmoother, FramesMayBeANanosecondApart) {
  auto one = measured(100, 0.002, 0.002), all = one;
  for (size_t k = 50; k < 100; ++k) one[k].time += 1e-9 - kStepTime;
  for (size_t k = 0; k < 100; ++k) all[k].time = 1e-9 * static_cast<double>(k);
  for (const auto& poses : {one, all}) {
    const std::vector<Rigid3> smoothed = smoothed_poses(poses);
    for (size_t k = 0; k < 100; ++k)  // the camera goes at most 20 mm from frame to frame
      EXPECT_LT((smoothed[k].translation - poses[k].world_from_cam.translation).norm(), 0.02) << k;
  }
}

TEST(PoseSmoother, APoseThatCannotBeSmoothedStaysAsMeasured) {
  auto poses = measured(10, 0.002, 0.002);
  poses[5].covariance *= std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(smoothed_poses(poses)[5].translation, poses[5].world_from_cam.translation);
}

TEST(PoseSmoother, FewPosesStayAsTheyAre) {
  EXPECT_TRUE(smoothed_poses({}).empty());
  const auto two = measured(2, 0.004, 0.003);
  EXPECT_EQ(smoothed_poses(two)[1].translation, two[1].world_from_cam.translation);
}

}  // namespace
}  // namespace dkb
