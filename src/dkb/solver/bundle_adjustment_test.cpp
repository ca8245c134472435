// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/bundle_adjustment.h"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <utility>

#include "dkb/solver/ceres_test_oracle.h"
#include "dkb/solver/test_world.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

BaOptions to_convergence() {
  BaOptions options;
  options.rounds = {60};
  options.relative_tolerance = 1e-12;
  return options;
}

double max_pose_difference(const std::vector<Rigid3>& a, const std::vector<Rigid3>& b) {
  double largest = 0;
  for (size_t c = 0; c < a.size(); ++c) {
    const Rigid3 d = a[c] * b[c].inverse();
    largest = std::max({largest, d.translation.norm(), vector_from_rotation(d.rotation).norm()});
  }
  return largest;
}

void expect_finite(const BaProblem& problem, const BaResult& result) {
  for (const Rigid3& pose : problem.cam_from_world) {
    EXPECT_TRUE(pose.translation.allFinite());
    EXPECT_TRUE(pose.rotation.coeffs().allFinite());
  }
  for (const Eigen::Vector3d& point : problem.points) EXPECT_TRUE(point.allFinite());
  EXPECT_TRUE(std::isfinite(result.initial_cost));
  EXPECT_TRUE(std::isfinite(result.final_cost));
}

TEST(BundleAdjustment, ReachesTheMinimumThatCeresReaches) {
  for (const double outliers : {0.0, 0.05}) {
    TestWorld world({.outlier_share = outliers, .seed = 7});
    BaProblem ours = world.problem, theirs = world.problem;
    const BaResult result = bundle_adjust(ours, to_convergence());
    const CeresBa oracle = ceres_bundle_adjust(theirs, {});
    EXPECT_NEAR(result.final_cost, oracle.final_cost, 1e-6 * oracle.final_cost);
    EXPECT_LT(max_pose_difference(ours.cam_from_world, theirs.cam_from_world), 1e-5);
  }
}

TEST(BundleAdjustment, WeightsCountAsCeresScalesTheLoss) {  // DKB eq. 48, without depth
  TestWorld world({.depth_share = 0, .outlier_share = 0.03, .seed = 9});
  for (BaObservation& o : world.problem.observations) o.weight = o.point % 3 == 0 ? 1.5 : 1.0;
  BaProblem ours = world.problem, theirs = world.problem;
  const BaResult result = bundle_adjust(ours, to_convergence());
  const CeresBa oracle = ceres_bundle_adjust(theirs, {});
  EXPECT_NEAR(result.final_cost, oracle.final_cost, 1e-6 * oracle.final_cost);
  EXPECT_LT(max_pose_difference(ours.cam_from_world, theirs.cam_from_world), 1e-4);
}

// From each camera to the one before it, as true as `sigma` [m, rad]; every fifth is 0.3 m off.
std::vector<PoseEdge> motions_of(const TestWorld& world, double sigma, bool robust) {
  Random random(5);
  std::vector<PoseEdge> motions;
  for (int c = 1; c < static_cast<int>(world.cam_from_world.size()); ++c) {
    Vector6d error;
    for (int k = 0; k < 6; ++k) error[k] = sigma * random.normal();
    if (c % 5 == 0) error[1] += 0.3;
    const Rigid3 previous_from_this = world.cam_from_world[c - 1] * world.cam_from_world[c].inverse();
    Vector6d weight;
    weight << 1, 2, 0.5, 3, 1, 2;
    Matrix6d information = weight.asDiagonal();
    information(0, 4) = information(4, 0) = 0.6;
    motions.push_back({c, c - 1, previous_from_this * rigid3_from_tangent(error), information / (sigma * sigma),
                       robust ? kChi2SixDof99 : PoseEdge().huber_chi2});
  }
  return motions;
}

TEST(BundleAdjustment, WithMotionsReachesTheMinimumThatCeresReaches) {
  for (const bool robust : {false, true}) {
    TestWorld world({.cameras = 12, .points = 60, .outlier_share = 0.02, .seed = 11});
    world.problem.motions = motions_of(world, 0.002, robust);
    BaProblem ours = world.problem, theirs = world.problem;
    const BaResult result = bundle_adjust(ours, to_convergence());
    const CeresBa oracle = ceres_bundle_adjust(theirs, {});
    EXPECT_NEAR(result.final_cost, oracle.final_cost, 1e-6 * oracle.final_cost);
    EXPECT_LT(max_pose_difference(ours.cam_from_world, theirs.cam_from_world), 1e-5);
  }
}

TEST(BundleAdjustment, MotionsAloneCarryCamerasThatShareNoPoint) {
  TestWorld world({.cameras = 6, .fixed = 1, .points = 200, .seed = 12});
  // The last three see nothing.
  std::erase_if(world.problem.observations, [](const BaObservation& o) { return o.camera > 2; });
  world.problem.motions = motions_of(world, 1e-6, true);
  std::erase_if(world.problem.motions, [](const PoseEdge& e) { return e.a % 5 == 0; });
  world.problem.motions.push_back(
      {5, 4, world.cam_from_world[4] * world.cam_from_world[5].inverse(), 1e12 * Matrix6d::Identity(), kChi2SixDof99});
  bundle_adjust(world.problem, to_convergence());
  const auto step = [](const std::vector<Rigid3>& poses, int c) { return poses[c] * poses[c - 1].inverse(); };
  for (int c = 3; c < 6; ++c)
    EXPECT_LT(max_pose_difference({step(world.problem.cam_from_world, c)}, {step(world.cam_from_world, c)}), 1e-5) << c;
}

TEST(BundleAdjustment, AMotionThatThePointsContradictIsLeftOutInTheEnd) {
  TestWorld world({.seed = 13});
  BaProblem plain = world.problem, wrong = world.problem;
  wrong.motions.push_back({8, 7,
                           rigid3_from_tangent((Vector6d() << 0.06, 0, 0, 0, 0, 0).finished()) *
                               (world.cam_from_world[7] * world.cam_from_world[8].inverse()),
                           1e5 * Matrix6d::Identity(), kChi2SixDof99});
  const auto pull = [&](std::vector<int> rounds) {
    BaProblem without = plain, with = wrong;
    BaOptions options;
    options.rounds = std::move(rounds);
    bundle_adjust(without, options);
    bundle_adjust(with, options);
    return max_pose_difference(without.cam_from_world, with.cam_from_world);
  };
  EXPECT_GT(pull({40}), 0.002) << "it pulls as long as it takes part";
  EXPECT_LT(pull({20, 20, 20}), 0.001) << "but for points near their limit";
}

TEST(BundleAdjustment, ManyCamerasTakeTheSparseWayToTheSameMinimum) {
  TestWorld world({.cameras = 45, .fixed = 1, .points = 600, .step = 0.2, .visibility = 0.5, .seed = 12});
  BaProblem ours = world.problem, theirs = world.problem;
  const BaResult result = bundle_adjust(ours, to_convergence());
  const CeresBa oracle = ceres_bundle_adjust(theirs, {.solver = ceres::SPARSE_SCHUR});
  EXPECT_NEAR(result.final_cost, oracle.final_cost, 1e-6 * oracle.final_cost);
  EXPECT_LT(max_pose_difference(ours.cam_from_world, theirs.cam_from_world), 1e-4);
}

TEST(BundleAdjustment, RecoversTheWorldWithoutNoise) {
  TestWorld world({.pixel_noise = 0, .depth_noise = 1e-9, .seed = 3});
  for (BaObservation& o : world.problem.observations) o.inv_depth_sigma = 100;
  const BaResult result = bundle_adjust(world.problem, to_convergence());
  EXPECT_LT(result.final_cost, 1e-8);
  EXPECT_EQ(std::count(result.outlier.begin(), result.outlier.end(), 1), 0);
  EXPECT_LT(max_pose_difference(world.problem.cam_from_world, world.cam_from_world), 1e-7);
  for (size_t p = 0; p < world.points.size(); ++p) {
    if (!std::count_if(world.problem.observations.begin(), world.problem.observations.end(),
                       [&](const BaObservation& o) { return o.point == static_cast<int>(p) && o.depth > 0; })) {
      continue;
    }
    EXPECT_LT((world.problem.points[p] - world.points[p]).norm(), 1e-5);
  }
}

TEST(BundleAdjustment, LeavesFixedCamerasAlone) {
  TestWorld world({.seed = 4});
  const BaProblem before = world.problem;
  bundle_adjust(world.problem);
  for (size_t c = 0; c < before.fixed.size(); ++c) {
    const bool same = before.cam_from_world[c].translation == world.problem.cam_from_world[c].translation;
    EXPECT_EQ(same, before.fixed[c] == 1);
  }
}

TEST(BundleAdjustment, FindsTheOutliers) {
  TestWorld world({.outlier_share = 0.1, .seed = 5});
  const BaResult result = bundle_adjust(world.problem);
  int missed = 0, wrongly = 0, outliers = 0;
  for (size_t i = 0; i < world.outlier.size(); ++i) {
    outliers += world.outlier[i];
    missed += world.outlier[i] && !result.outlier[i];
    wrongly += !world.outlier[i] && result.outlier[i];
  }
  EXPECT_LT(missed, 0.01 * outliers);
  EXPECT_LT(wrongly, 0.05 * (world.outlier.size() - outliers));
  EXPECT_LT(max_pose_difference(world.problem.cam_from_world, world.cam_from_world), 0.01);
}

TEST(BundleAdjustment, RemovingOutliersIsLeastSquaresOfTheRestOnceNoneAreLeft) {
  TestWorld world({.outlier_share = 0.1, .seed = 6});
  BaOptions options = to_convergence();
  options.rounds = {20, 20, 20, 60};
  BaProblem ours = world.problem;
  const BaResult result = bundle_adjust(ours, options);
  BaProblem theirs = ours;
  ceres_bundle_adjust(theirs, {.robust = false}, result.outlier);
  EXPECT_LT(max_pose_difference(ours.cam_from_world, theirs.cam_from_world), 1e-4);
}

TEST(BundleAdjustment, PrefilterKeepsWhatIsBeyondTheLimitOut) {  // DKB section 3.3
  TestWorld world({.outlier_share = 0.1, .pose_error = 0.001, .point_error = 0.001, .seed = 6});
  BaOptions options = to_convergence();
  BaProblem with = world.problem;
  options.prefilter = true;
  const BaResult filtered = bundle_adjust(with, options);
  options.prefilter = false;
  BaProblem without = world.problem;
  const BaResult all = bundle_adjust(without, options);
  EXPECT_LT(filtered.initial_cost, 0.5 * all.initial_cost);
  EXPECT_LE(filtered.initial_cost, 7.815 * static_cast<double>(world.problem.observations.size()));
}

TEST(BundleAdjustment, RepeatedObservationsCountTwice) {
  TestWorld world({.cameras = 5, .fixed = 2, .points = 60, .seed = 8});
  BaProblem twice = world.problem, doubled = world.problem;
  twice.observations.insert(twice.observations.end(), world.problem.observations.begin(),
                            world.problem.observations.end());
  for (BaObservation& o : doubled.observations) {
    o.inv_sigma *= std::sqrt(2.0);
    o.inv_depth_sigma *= std::sqrt(2.0);
  }
  BaOptions options = to_convergence();
  options.chi2_pixel = options.chi2_depth = 1e9;  // least squares
  const BaResult a = bundle_adjust(twice, options), b = bundle_adjust(doubled, options);
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-9 * b.final_cost);
  EXPECT_LT(max_pose_difference(twice.cam_from_world, doubled.cam_from_world), 1e-8);
}

TEST(BundleAdjustment, APointOnOneRayMovesOnlyAcrossIt) {
  BaProblem problem;
  problem.cam_from_world = {Rigid3()};
  problem.fixed = {1};
  problem.points = {{0.2, 0.1, 2.0}, {0.0, 0.0, 1.0}};
  BaObservation o;
  const Eigen::Vector2d pixel = problem.camera.project({0.21, 0.1, 2.0});
  o.u = pixel.x(), o.v = pixel.y();
  problem.observations = {o};
  const BaResult result = bundle_adjust(problem);
  EXPECT_LT(result.final_cost, 1e-6);
  EXPECT_LT((problem.points[0] - Eigen::Vector3d(0.2, 0.1, 2.0)).norm(), 0.0101);
  EXPECT_EQ(problem.points[1], Eigen::Vector3d(0, 0, 1));  // nobody sees it
}

TEST(BundleAdjustment, ObservationsBehindTheirCameraAreOutliersAndDoNoHarm) {
  TestWorld world({.seed = 3});
  BaProblem with = world.problem;
  for (int k = 0; k < 40; ++k) {
    BaObservation o = with.observations[17 * k];
    const Rigid3& pose = with.cam_from_world[o.camera];
    o.point = static_cast<int>(with.points.size());
    with.points.push_back(pose.inverse() * Eigen::Vector3d(0.2, 0.1, k % 2 ? 0.0 : -1.0));
    with.observations.push_back(o);
  }
  BaProblem without = world.problem;
  const BaResult a = bundle_adjust(with), b = bundle_adjust(without);
  expect_finite(with, a);
  EXPECT_LT(max_pose_difference(with.cam_from_world, without.cam_from_world), 1e-9);
  EXPECT_NEAR(a.final_cost, b.final_cost, 1e-9 * b.final_cost);
  for (size_t i = world.problem.observations.size(); i < with.observations.size(); ++i) EXPECT_TRUE(a.outlier[i]);
}

TEST(BundleAdjustment, DegenerateProblemsStayFinite) {
  BaProblem empty;
  EXPECT_EQ(bundle_adjust(empty).final_cost, 0);

  TestWorld world({.cameras = 3, .fixed = 0, .points = 30, .depth_share = 0, .seed = 3});
  BaProblem free = world.problem;  // nothing fixed, no scale: seven directions without information
  const BaResult result = bundle_adjust(free);
  expect_finite(free, result);
  EXPECT_LE(result.final_cost, result.initial_cost);

  BaProblem unobserved = world.problem;
  unobserved.observations.clear();
  expect_finite(unobserved, bundle_adjust(unobserved));

  BaProblem all_fixed = world.problem;
  all_fixed.fixed.assign(3, 1);
  expect_finite(all_fixed, bundle_adjust(all_fixed));

  BaProblem single = world.problem;  // each point along one ray
  std::erase_if(single.observations, [](const BaObservation& o) { return o.camera != 0; });
  expect_finite(single, bundle_adjust(single));

  BaProblem one_place = world.problem;  // all points in one place
  for (Eigen::Vector3d& point : one_place.points) point = {0, 0, 2};
  expect_finite(one_place, bundle_adjust(one_place));
}

TEST(BundleAdjustment, TheSameInputGivesTheSameBits) {
  const TestWorld world({.outlier_share = 0.05, .seed = 8});
  BaProblem a = world.problem, b = world.problem;
  const BaResult first = bundle_adjust(a), second = bundle_adjust(b);
  EXPECT_EQ(first.final_cost, second.final_cost);
  EXPECT_EQ(first.outlier, second.outlier);
  EXPECT_EQ(a.points, b.points);
  for (size_t c = 0; c < a.cam_from_world.size(); ++c) {
    EXPECT_EQ(a.cam_from_world[c].translation, b.cam_from_world[c].translation);
    EXPECT_EQ(a.cam_from_world[c].rotation.coeffs(), b.cam_from_world[c].rotation.coeffs());
  }
}

TEST(BundleAdjustment, RefusesIndicesThatDoNotFit) {
  TestWorld world({.cameras = 2, .points = 10});
  BaProblem problem = world.problem;
  problem.observations[0].point = 10;
  EXPECT_THROW(bundle_adjust(problem), InputError);
  problem = world.problem;
  problem.observations[0].camera = -1;
  EXPECT_THROW(bundle_adjust(problem), InputError);
  problem = world.problem;
  problem.fixed.pop_back();
  EXPECT_THROW(bundle_adjust(problem), InputError);
  problem = world.problem;
  problem.motions.push_back({0, 2, {}, Matrix6d::Identity(), kChi2SixDof99});
  EXPECT_THROW(bundle_adjust(problem), InputError);
  BaOptions options;
  options.rounds = {};
  EXPECT_THROW(bundle_adjust(problem, options), InvalidOption);
}

// Squared errors of the last camera by the covariance that was told of it, per degree of freedom: mean of 60 worlds. In
// each part of each image depths have an error of this standard deviation [m] in common.
double normalised_error(double pixel_noise, double depth_share, int points = 150, double common_depth_error = 0) {
  constexpr int kWorlds = 60;
  double sum = 0;
  for (uint64_t seed = 1; seed <= kWorlds; ++seed) {
    TestWorld world({.cameras = 6,
                     .fixed = 2,
                     .points = points,
                     .pixel_noise = pixel_noise,
                     .depth_share = depth_share,
                     .pose_error = 0.005,
                     .point_error = 0.01,
                     .seed = seed});
    BaOptions options = to_convergence();
    options.chi2_pixel = options.chi2_depth = 1e6;
    world.problem.asked = 5;
    Random random(seed);
    std::map<std::array<int, 3>, double> common;
    for (BaObservation& o : world.problem.observations) {
      const Eigen::Vector3d at = world.cam_from_world[5] * world.points[static_cast<size_t>(o.point)];
      const std::array<int, 3> part = {o.camera, static_cast<int>(std::floor(10 * at.x() / at.z())),
                                       static_cast<int>(std::floor(10 * at.y() / at.z()))};
      if (!common.contains(part)) common[part] = common_depth_error * random.normal();
      if (o.depth > 0) o.depth += common[part];
    }
    const BaResult result = bundle_adjust(world.problem, options);
    if (!result.covariance) return -1;
    const Vector6d error = tangent_from_rigid3(world.problem.cam_from_world[5] * world.cam_from_world[5].inverse());
    sum += error.dot(result.covariance->llt().solve(error)) / 6;
  }
  return sum / kWorlds;
}

// 360 degrees of freedom: the mean varies by 7.5%.
TEST(BundleAdjustment, TheCovarianceOfACameraIsTrue) {
  EXPECT_NEAR(normalised_error(1, 0.7), 1, 0.25);
}

TEST(BundleAdjustment, TheCovarianceKnowsWhenErrorsAreLargerThanClaimed) {
  EXPECT_NEAR(normalised_error(2, 0), 1, 0.25);
}

TEST(BundleAdjustment, TheCovarianceKnowsOfErrorsThatPointsSideBySideHaveInCommon) {
  // 6.5 if errors are taken to be independent. The parts that have an error in common are 50 px wide here and in other
  // places than those that are told apart, so that a half of what is in common is seen.
  EXPECT_LT(normalised_error(1, 1, 1500, 0.02), 3);
}

TEST(BundleAdjustment, TheCovarianceIsTheInverseOfTheNormalEquationsByWhatPartsOfTheImagePull) {
  TestWorld world({.cameras = 5, .fixed = 2, .points = 120, .pixel_noise = 1, .seed = 3});
  world.problem.asked = 3;
  const BaResult result = bundle_adjust(world.problem, to_convergence());
  ASSERT_TRUE(result.covariance);
  EXPECT_TRUE(result.covariance->isApprox(result.covariance->transpose()));
  // The dense normal equations of the cameras and points, by differences of the residuals.
  const BaProblem& p = world.problem;
  const int n = 6 * 3 + 3 * static_cast<int>(p.points.size());
  const auto residual = [&](const BaObservation& o, const Rigid3& pose, const Eigen::Vector3d& point) {
    const Eigen::Vector3d c = pose * point;
    const Eigen::Vector2d at = p.camera.project(c);
    return Eigen::Vector3d((at.x() - o.u) * o.inv_sigma, (at.y() - o.v) * o.inv_sigma,
                           o.depth > 0 ? (c.z() - o.depth) * o.inv_depth_sigma : 0.0);
  };
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  std::map<std::pair<int, int>, Eigen::VectorXd> pulls;
  for (size_t i = 0; i < p.observations.size(); ++i) {
    const BaObservation& o = p.observations[i];
    const Rigid3& pose = p.cam_from_world[static_cast<size_t>(o.camera)];
    const Eigen::Vector3d& point = p.points[static_cast<size_t>(o.point)];
    const Eigen::Vector3d here = residual(o, pose, point);
    const double corner = o.depth > 0 ? 7.815 : 5.991, square = here.squaredNorm();
    if (square > corner) continue;  // an outlier
    Eigen::Matrix<double, 3, 9> jacobian;
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 9; ++k) {
      Vector6d d = Vector6d::Zero();
      Eigen::Vector3d e = Eigen::Vector3d::Zero();
      (k < 6 ? d[k] : e[k - 6]) = kStep;
      jacobian.col(k) = (residual(o, (pose.inverse() * rigid3_from_tangent(d)).inverse(), point + e) - here) / kStep;
    }
    std::vector<int> at;
    for (int k = 0; k < 6; ++k) at.push_back(o.camera < 2 ? -1 : 6 * (o.camera - 2) + k);
    for (int k = 0; k < 3; ++k) at.push_back(18 + 3 * o.point + k);
    const Eigen::Vector3d asked = p.cam_from_world[3] * point;
    const double side = p.camera.width / 16.0;
    const std::pair<int, int> part(static_cast<int>(std::floor(p.camera.fx * asked.x() / asked.z() / side)),
                                   static_cast<int>(std::floor(p.camera.fy * asked.y() / asked.z() / side)));
    Eigen::VectorXd& pull = pulls.try_emplace(part, Eigen::VectorXd::Zero(n)).first->second;
    for (int a = 0; a < 9; ++a)
      if (at[static_cast<size_t>(a)] >= 0) pull[at[static_cast<size_t>(a)]] += jacobian.col(a).dot(here);
    for (int a = 0; a < 9; ++a)
      for (int b = 0; b < 9; ++b)
        if (at[static_cast<size_t>(a)] >= 0 && at[static_cast<size_t>(b)] >= 0)
          normal(at[static_cast<size_t>(a)], at[static_cast<size_t>(b)]) += jacobian.col(a).dot(jacobian.col(b));
  }
  normal.diagonal().array() += 1e-9;
  const Eigen::MatrixXd inverse = normal.ldlt().solve(Eigen::MatrixXd::Identity(n, n));
  const Matrix6d claimed = inverse.block<6, 6>(6, 6);
  double factor = 0;
  for (const auto& [part, pull] : pulls) {
    const Vector6d moves = inverse.middleRows<6>(6) * pull;
    factor += moves.dot(claimed.llt().solve(moves)) / 6;
  }
  const auto parts = static_cast<double>(pulls.size());
  const Matrix6d expected = (parts * factor + 1) / (parts + 1) * claimed;
  EXPECT_LT((*result.covariance - expected).norm(), 0.02 * expected.norm());
}

TEST(BundleAdjustment, AFixedCameraHasNoCovarianceAndNobodyIsAskedByItself) {
  TestWorld world({.cameras = 5, .fixed = 2, .points = 100});
  EXPECT_FALSE(bundle_adjust(world.problem).covariance);
  world.problem.asked = 0;
  EXPECT_FALSE(bundle_adjust(world.problem).covariance);
}

}  // namespace
}  // namespace dkb
