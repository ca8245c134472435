// SPDX-License-Identifier: Apache-2.0
#include "dkb/geometry/alignment.h"

#include <gtest/gtest.h>

#include <vector>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {
using Points = std::vector<Eigen::Vector3d>;

Points random_points(int n, uint64_t seed, Eigen::Vector3d spread = {1, 2, 3}) {
  Random random(seed);
  Points points;
  for (int i = 0; i < n; ++i)
    points.push_back({spread.x() * random.normal(), spread.y() * random.normal(), spread.z() * random.normal()});
  return points;
}

TEST(AlignUmeyama, RecoversAQuarterTurnAndAShift) {
  // A quarter turn about z maps (x, y, z) to (-y, x, z); then (1, 2, 3) is added.
  const Points from{{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  const Points to{{1, 2, 3}, {1, 3, 3}, {-1, 2, 3}, {1, 2, 6}};
  const Similarity3 s = align_umeyama(from, to, true);
  EXPECT_NEAR(s.scale, 1.0, 1e-12);
  for (size_t i = 0; i < from.size(); ++i) EXPECT_LT((s * from[i] - to[i]).norm(), 1e-12);
}

TEST(AlignUmeyama, RecoversASimilarityExactly) {
  const Points from = random_points(50, 3);
  const Rigid3 motion(rotation_from_vector({0.3, -1.2, 2.0}), {10, -20, 30});
  Points to;
  for (const auto& p : from) to.push_back(0.4 * (motion.rotation * p) + motion.translation);
  const Similarity3 s = align_umeyama(from, to, true);
  EXPECT_NEAR(s.scale, 0.4, 1e-12);
  EXPECT_LT(s.motion.rotation.angularDistance(motion.rotation), 1e-10);
  EXPECT_LT((s.motion.translation - motion.translation).norm(), 1e-10);
}

TEST(AlignUmeyama, ScaleStaysOneUnlessAsked) {
  const Points from = random_points(20, 5);
  Points to;
  for (const auto& p : from) to.push_back(2 * p);
  EXPECT_EQ(align_umeyama(from, to, false).scale, 1.0);
}

TEST(AlignUmeyama, NeverAnswersWithAReflection) {
  Points from = random_points(30, 7), to;
  for (const auto& p : from) to.emplace_back(p.x(), p.y(), -p.z());
  const Similarity3 s = align_umeyama(from, to, false);
  EXPECT_NEAR(s.motion.matrix3().determinant(), 1.0, 1e-12);
}

TEST(AlignUmeyama, NoSmallMotionLowersTheError) {
  const Points from = random_points(40, 9), noise = random_points(40, 10, {0.1, 0.1, 0.1});
  const Rigid3 motion(rotation_from_vector({0.1, 0.2, 0.3}), {1, 2, 3});
  Points to;
  for (size_t i = 0; i < from.size(); ++i) to.push_back(motion * from[i] + noise[i]);
  for (const bool with_scale : {false, true}) {
    const Similarity3 best = align_umeyama(from, to, with_scale);
    const auto cost = [&](const Similarity3& s) {
      double sum = 0;
      for (size_t i = 0; i < from.size(); ++i) sum += (to[i] - s * from[i]).squaredNorm();
      return sum;
    };
    for (int axis = 0; axis < 6; ++axis)
      for (const double step : {-1e-4, 1e-4}) {
        Vector6d d = Vector6d::Zero();
        d[axis] = step;
        Similarity3 other = best;
        other.motion = rigid3_from_tangent(d) * best.motion;
        EXPECT_GT(cost(other), cost(best));
      }
    if (with_scale)
      for (const double step : {-1e-4, 1e-4}) {
        Similarity3 other = best;
        other.scale += step;
        EXPECT_GT(cost(other), cost(best));
      }
  }
}

TEST(AlignUmeyama, DegeneratePointsGiveARotation) {
  for (const Points& from :
       {Points{{1, 2, 3}}, Points{{1, 2, 3}, {1, 2, 3}}, Points{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}}}) {
    const Similarity3 s = align_umeyama(from, from, true);
    EXPECT_NEAR(s.scale, 1.0, 1e-12);
    EXPECT_NEAR(s.motion.matrix3().determinant(), 1.0, 1e-12);
    for (const auto& p : from) EXPECT_LT((s * p - p).norm(), 1e-12);
  }
}

TEST(AlignUmeyama, RefusesUnequalOrEmptySets) {
  const Points one{{0, 0, 0}}, two{{0, 0, 0}, {1, 1, 1}};
  EXPECT_THROW(align_umeyama(one, two, false), InputError);
  EXPECT_THROW(align_umeyama({}, {}, false), InputError);
}

}  // namespace
}  // namespace dkb
