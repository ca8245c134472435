// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/floor_plane.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

// A horizontal rectangle (y down) of facets 0.1 m wide that look up, at height -y.
void add_plane(SurfaceMesh* mesh, double width, double depth, double y, double slope = 0) {
  for (int i = 0; i < static_cast<int>(width * 10); ++i)
    for (int j = 0; j < static_cast<int>(depth * 10); ++j) {
      const auto base = static_cast<int32_t>(mesh->vertices.size());
      for (int c = 0; c < 4; ++c) {
        const double x = 0.1 * (i + (c & 1)), z = 0.1 * (j + (c >> 1));
        mesh->vertices.emplace_back(static_cast<float>(x), static_cast<float>(y + slope * x), static_cast<float>(z));
      }
      mesh->triangles.push_back({base, base + 1, base + 2});  // x cross z = -y: up
      mesh->triangles.push_back({base + 1, base + 3, base + 2});
    }
}

TEST(FloorPlane, IsFoundUnderALargerTable) {
  SurfaceMesh mesh;
  add_plane(&mesh, 2, 2, 0.4);
  add_plane(&mesh, 2, 0.8, 1.2);
  const auto floor = find_floor(mesh, {0.2, -1, 0.1}, 1);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->height, -1.2, 1e-4);
  EXPECT_TRUE(floor->up.isApprox(Eigen::Vector3d(0, -1, 0), 1e-4));
}

TEST(FloorPlane, IsNotASmallThingBelow) {
  SurfaceMesh mesh;
  add_plane(&mesh, 2, 2, 0.4);
  add_plane(&mesh, 0.5, 0.6, 1.2);
  EXPECT_NEAR(find_floor(mesh, {0, -1, 0}, 1)->height, -0.4, 1e-4);
}

TEST(FloorPlane, MayLeanAgainstTheGuess) {
  SurfaceMesh mesh;
  add_plane(&mesh, 2, 2, 1, std::tan(0.3));
  const auto floor = find_floor(mesh, {0, -1, 0}, 1);
  ASSERT_TRUE(floor);
  EXPECT_NEAR(floor->up.dot(Eigen::Vector3d(0, -1, 0)), std::cos(0.3), 1e-3);
}

TEST(FloorPlane, NothingWithoutAPlaneThatLooksUp) {
  SurfaceMesh mesh;
  EXPECT_FALSE(find_floor(mesh, {0, -1, 0}, 1));
  add_plane(&mesh, 0.4, 0.4, 1);
  EXPECT_FALSE(find_floor(mesh, {0, -1, 0}, 1));  // too small
  add_plane(&mesh, 2, 2, 1);
  EXPECT_FALSE(find_floor(mesh, {0, 1, 0}, 1));  // seen from below
}

TEST(FloorPlane, FrameStandsOnTheFloor) {
  const FloorPlane floor{{0, -1, 0}, -1.2, 1};
  const Rigid3 m = floor_from_world(floor, {0, 0.3, 1});
  EXPECT_TRUE((m * Eigen::Vector3d(0, 0, 0)).isApprox(Eigen::Vector3d(0, 0, 1.2)));
  EXPECT_TRUE((m * Eigen::Vector3d(0, 1.2, 2)).isApprox(Eigen::Vector3d(2, 0, 0)));
  EXPECT_TRUE((m * Eigen::Vector3d(1, 1.2, 0)).isApprox(Eigen::Vector3d(0, -1, 0)));  // right of forward
}

}  // namespace
}  // namespace dkb
