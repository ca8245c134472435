// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/visibility.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dkb/util/random.h"

namespace dkb {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// DKB eq. 26 as written: all pairs.
std::vector<int> nearest_by_all_pairs(const Points& cloud, int of) {
  std::vector<int> order;
  for (int i = 0; i < static_cast<int>(cloud.size()); ++i)
    if (i != of) order.push_back(i);
  const auto distance = [&](int i) {
    return (cloud[static_cast<size_t>(i)] - cloud[static_cast<size_t>(of)]).squaredNorm();
  };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return distance(a) < distance(b); });
  order.resize(std::min(order.size(), kNormalNeighbours));
  return order;
}

TEST(NearestNeighbours, EqualTheSearchOverAllPairs) {
  Random random(3);
  Points cloud;
  for (int i = 0; i < 400; ++i) cloud.push_back({random.uniform(-2, 2), random.uniform(-1, 1), random.uniform(1, 1.2)});
  std::vector<int> of(cloud.size());
  std::iota(of.begin(), of.end(), 0);
  const auto found = nearest_neighbours(cloud, of);
  for (int i : of) EXPECT_EQ(found[static_cast<size_t>(i)], nearest_by_all_pairs(cloud, i)) << i;
}

TEST(NearestNeighbours, BreakTiesByIndex) {
  Points cloud;  // a grid: many neighbours are equally far, and every place is taken twice
  for (int copy = 0; copy < 2; ++copy)
    for (int x = 0; x < 8; ++x)
      for (int y = 0; y < 8; ++y) cloud.emplace_back(0.125 * x, 0.125 * y, 1);
  std::vector<int> of(cloud.size());
  std::iota(of.begin(), of.end(), 0);
  const auto found = nearest_neighbours(cloud, of);
  for (int i : of) EXPECT_EQ(found[static_cast<size_t>(i)], nearest_by_all_pairs(cloud, i)) << i;
}

TEST(NearestNeighbours, AreFewerInASmallCloud) {
  const Points cloud = {{0, 0, 0}, {1, 0, 0}, {0, 3, 0}};
  const std::vector<int> of = {0, 2};
  EXPECT_EQ(nearest_neighbours(cloud, of), (std::vector<std::vector<int>>{{1, 2}, {0, 1}}));
  EXPECT_TRUE(nearest_neighbours({}, {}).empty());
}

TEST(SurfaceNormal, OfAPlaneFacesTheFirstCamera) {  // DKB eqs. 27-30
  const Points around = {{1, 0, 5}, {0, 1, 5}, {-1, 0, 5}, {0, -1, 5}, {2, 1, 5}};
  for (NormalSum sum : {NormalSum::oriented, NormalSum::plain}) {
    const auto from_front = surface_normal({0, 0, 5}, around, {0, 0, 0}, sum);
    const auto from_behind = surface_normal({0, 0, 5}, around, {3, 1, 9}, sum);
    ASSERT_TRUE(from_front && from_behind);
    EXPECT_NEAR((*from_front - Eigen::Vector3d(0, 0, -1)).norm(), 0, 1e-12);
    EXPECT_NEAR((*from_behind - Eigen::Vector3d(0, 0, 1)).norm(), 0, 1e-12);
  }
}

TEST(SurfaceNormal, SumsTheProductsOfAllPairs) {
  // V = x, y, 2x, z, z: the products are xy = z, x2x = 0, xz = -y (twice), y2x = -2z, yz = x (twice), 2xz = -2y
  // (twice), zz = 0. Plain: (2, -6, -1). Turned toward a camera far along +x +y +z: z, y, y, 2z, x, x, 2y, 2y = (2, 6,
  // 3).
  const Points around = {{1, 0, 0}, {0, 1, 0}, {2, 0, 0}, {0, 0, 1}, {0, 0, 1}};
  const Eigen::Vector3d camera(9, 9, 9);
  const auto oriented = surface_normal({0, 0, 0}, around, camera, NormalSum::oriented);
  ASSERT_TRUE(oriented);
  EXPECT_NEAR((*oriented - Eigen::Vector3d(2, 6, 3) / 7).norm(), 0, 1e-12);
  // (2, -6, -1) looks away from the camera and is turned once as a whole.
  const auto plain = surface_normal({0, 0, 0}, around, camera, NormalSum::plain);
  ASSERT_TRUE(plain);
  EXPECT_NEAR((*plain - Eigen::Vector3d(-2, 6, 1) / std::sqrt(41.0)).norm(), 0, 1e-12);
}

TEST(SurfaceNormal, ThePlainSumCancelsWhereTheTurnedOneDoesNot) {
  // In the plane z = 5 the products are 1, -1, 1, -2, 0, 2, -3, -2, 3, 1 along z: 0 in all, 16 when turned.
  const Points around = {{0, -1, 5}, {1, -1, 5}, {-1, 1, 5}, {1, 1, 5}, {-2, -1, 5}};
  EXPECT_FALSE(surface_normal({0, 0, 5}, around, {0, 0, 0}, NormalSum::plain));
  const auto oriented = surface_normal({0, 0, 5}, around, {0, 0, 0}, NormalSum::oriented);
  ASSERT_TRUE(oriented);
  EXPECT_NEAR(oriented->z(), -1, 1e-12);
}

TEST(SurfaceNormal, IsNotThereWithFewerThanFiveNeighbours) {
  const Points around = {{1, 0, 5}, {0, 1, 5}, {-1, 0, 5}, {0, -1, 5}};
  EXPECT_FALSE(surface_normal({0, 0, 5}, around, {0, 0, 0}, NormalSum::oriented));
  EXPECT_FALSE(surface_normal({0, 0, 5}, {}, {0, 0, 0}, NormalSum::oriented));
}

TEST(SurfaceNormal, IsNotThereOnALineOrAtOnePlace) {
  const Points line = {{1, 2, 3}, {2, 4, 6}, {-1, -2, -3}, {3, 6, 9}, {-2, -4, -6}};
  const Points one_place(5, Eigen::Vector3d(0, 0, 0));
  for (NormalSum sum : {NormalSum::oriented, NormalSum::plain}) {
    EXPECT_FALSE(surface_normal({0, 0, 0}, line, {5, 0, 0}, sum));
    EXPECT_FALSE(surface_normal({0, 0, 0}, one_place, {5, 0, 0}, sum));
  }
}

TEST(ViewAngle, IsBetweenNormalAndDirectionToTheCamera) {  // DKB eq. 31
  EXPECT_NEAR(view_angle_deg({0, 0, 1}, {0, 0, 4}), 0, 1e-12);
  EXPECT_NEAR(view_angle_deg({0, 0, 1}, {3, 0, 3}), 45, 1e-12);
  EXPECT_NEAR(view_angle_deg({0, 0, 1}, {0, 2, 0}), 90, 1e-12);
  EXPECT_NEAR(view_angle_deg({0, 0, 1}, {0, 0, -1}), 180, 1e-12);
}

TEST(VisibilityLevel, StepsEveryTenDegrees) {  // DKB eq. 32
  EXPECT_EQ(visibility_level(0, 4), 1);
  EXPECT_EQ(visibility_level(10, 4), 1);
  EXPECT_EQ(visibility_level(10.001, 4), 2);
  EXPECT_EQ(visibility_level(20, 4), 2);
  EXPECT_EQ(visibility_level(30, 4), 3);
  EXPECT_EQ(visibility_level(30.001, 4), 4);
  EXPECT_EQ(visibility_level(175, 4), 4);
  EXPECT_EQ(visibility_level(45, 9), 5);
  EXPECT_EQ(visibility_level(89, 9), 9);
  EXPECT_EQ(visibility_level(120, 9), 9);
}

// A wall of points at z = 2 that one keyframe at `centre` saw.
Map wall(int side, const Eigen::Vector3d& centre) {
  auto features = std::make_shared<RgbdFeatures>();
  features->keypoints.resize(static_cast<size_t>(side * side));
  features->descriptors.resize(features->keypoints.size());
  Keyframe k;
  k.id = 0;
  k.points.assign(features->keypoints.size(), kNoPoint);
  k.features = std::move(features);
  k.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), centre).inverse();
  Map map;
  map.add_keyframe(std::move(k));
  for (int i = 0; i < side * side; ++i) {
    MapPoint p;
    p.id = make_point_id(0, i);
    p.position = {0.1 * (i % side), 0.1 * (i / side), 2};
    map.add_point(std::move(p));
    map.observe(make_point_id(0, i), 0, i);
  }
  return map;
}

TEST(SurfaceNormals, FaceTheKeyframeThatThePointsAreNamedAfter) {
  const std::vector<PointId> of = {make_point_id(0, 7), make_point_id(0, 12)};
  const Map front = wall(5, {0, 0, 0}), behind = wall(5, {0, 0, 4});
  for (const auto& n : surface_normals(front, of, front.live_points(), NormalSum::oriented))
    EXPECT_NEAR((n.value() - Eigen::Vector3d(0, 0, -1)).norm(), 0, 1e-12);
  for (const auto& n : surface_normals(behind, of, behind.live_points(), NormalSum::oriented))
    EXPECT_NEAR((n.value() - Eigen::Vector3d(0, 0, 1)).norm(), 0, 1e-12);
}

TEST(SurfaceNormals, AreNotThereInATinyMap) {
  const Map map = wall(2, {0, 0, 0});
  const auto normals = surface_normals(map, map.live_points(), map.live_points(), NormalSum::oriented);
  EXPECT_EQ(normals.size(), 4u);
  for (const auto& n : normals) EXPECT_FALSE(n.has_value());
}

}  // namespace
}  // namespace dkb
