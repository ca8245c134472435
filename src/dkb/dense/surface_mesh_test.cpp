// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/surface_mesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <map>

#include "dkb/dense/dense_test_scene.h"

namespace dkb {
namespace {

using testing::DenseScene;

SurfaceMesh scene_mesh() {
  const DenseScene scene;
  const DenseOptions options = testing::scene_options();
  const DepthViewMaker maker(testing::scene_camera(), options);
  std::vector<DepthView> views;
  for (int i = 0; i < 6; ++i)
    views.push_back(maker.make(i, scene.draw(testing::scene_camera(), testing::scene_pose(i), 0.1 * i), 0.1 * i, {}));
  std::vector<PlacedView> placed;
  for (int i = 0; i < 6; ++i) placed.push_back({&views[static_cast<size_t>(i)], testing::scene_pose(i).inverse()});
  return extract_surface(TsdfVolume::fuse(placed, maker.camera(), {}, options));
}

SurfaceMesh square(float side, float x) {
  SurfaceMesh mesh;
  mesh.vertices = {{x, 0, 0}, {x + side, 0, 0}, {x + side, side, 0}, {x, side, 0}};
  mesh.colours.assign(4, Rgb{1, 2, 3});
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

TEST(SurfaceMesh, LiesOnPlanesAndBallWithinMillimetres) {
  const DenseScene scene;
  const SurfaceMesh mesh = scene_mesh();
  ASSERT_GT(mesh.vertices.size(), 5000u);
  std::vector<double> errors;
  for (const auto& v : mesh.vertices) errors.push_back(scene.distance(v.cast<double>()));
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.004);
  EXPECT_LT(errors[errors.size() * 95 / 100], 0.02);
  for (const Rgb& c : mesh.colours) ASSERT_EQ(c, (Rgb{200, 120, 40}));
}

TEST(SurfaceMesh, TrianglesFaceTheCameras) {
  const SurfaceMesh mesh = scene_mesh();
  ASSERT_FALSE(mesh.triangles.empty());
  size_t facing = 0;
  for (const auto& t : mesh.triangles) {
    const auto at = [&](size_t i) { return mesh.vertices[static_cast<size_t>(t[i])]; };
    const Eigen::Vector3f normal = (at(1) - at(0)).cross(at(2) - at(0));
    facing += normal.dot(-at(0)) > 0 ? 1 : 0;  // the cameras are near the origin
  }
  EXPECT_GT(static_cast<double>(facing), 0.97 * static_cast<double>(mesh.triangles.size()));
}

TEST(SurfaceMesh, EdgesBelongToAtMostTwoTrianglesAlsoAcrossBlocks) {
  const SurfaceMesh mesh = scene_mesh();
  std::map<std::pair<int32_t, int32_t>, int> edges;
  for (const auto& t : mesh.triangles)
    for (size_t i = 0; i < 3; ++i) ++edges[std::minmax(t[i], t[(i + 1) % 3])];
  size_t inner = 0, many = 0;
  for (const auto& [edge, count] : edges) {
    inner += count == 2 ? 1 : 0;
    many += count > 2 ? 1 : 0;
  }
  EXPECT_GT(static_cast<double>(inner), 0.9 * static_cast<double>(edges.size()));
  EXPECT_LT(static_cast<double>(many), 0.01 * static_cast<double>(edges.size()));
}

TEST(SurfaceMesh, SmallPartsAreDropped) {
  SurfaceMesh both = square(1, 0);
  const SurfaceMesh speck = square(0.1F, 5);
  for (const auto& t : speck.triangles) both.triangles.push_back({t[0] + 4, t[1] + 4, t[2] + 4});
  both.vertices.insert(both.vertices.begin() + 4, speck.vertices.begin(), speck.vertices.end());
  both.vertices.emplace_back(9, 9, 9);  // of no triangle
  both.colours.resize(9);
  const SurfaceMesh kept = without_small_parts(both, 0.02);
  EXPECT_EQ(kept.vertices, square(1, 0).vertices);
  EXPECT_EQ(kept.triangles, square(1, 0).triangles);
  EXPECT_EQ(without_small_parts(both, 0.005).triangles.size(), 4u);
  EXPECT_TRUE(without_small_parts({}, 0.02).vertices.empty());
}

TEST(SurfaceMesh, PlyHoldsVerticesColoursAndFaces) {
  const std::string ply = mesh_ply(square(1, 0));
  const std::string header_end = "end_header\n";
  const size_t at = ply.find(header_end) + header_end.size();
  EXPECT_NE(ply.find("element vertex 4\n"), std::string::npos);
  EXPECT_NE(ply.find("element face 2\n"), std::string::npos);
  ASSERT_EQ(ply.size() - at, 4u * 15 + 2 * 13);
  float x = 0;
  std::memcpy(&x, ply.data() + at + 15, 4);
  EXPECT_EQ(x, 1.0F);
  EXPECT_EQ(ply[at + 12], 1);
  int32_t corner = 0;
  std::memcpy(&corner, ply.data() + at + 60 + 13 + 9, 4);
  EXPECT_EQ(ply[at + 60], 3);
  EXPECT_EQ(corner, 3);
}

}  // namespace
}  // namespace dkb
