// SPDX-License-Identifier: Apache-2.0
#include "dkb/solver/bundle_adjustment.h"

#include <gtest/gtest.h>

#include "dkb/solver/ceres_oracle.h"
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

double largest_pose_difference(const std::vector<Rigid3>& a, const std::vector<Rigid3>& b) {
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
    EXPECT_LT(largest_pose_difference(ours.cam_from_world, theirs.cam_from_world), 1e-5);
  }
}

}  // namespace
}  // namespace dkb
