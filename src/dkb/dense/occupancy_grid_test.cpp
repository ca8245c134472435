// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/occupancy_grid.h"

#include <gtest/gtest.h>

#include <sstream>

namespace dkb {
namespace {

// A floor 2 m x 1 m in a world with z up, its lower left corner at the origin, and a post of 0.8 m at (1.52, 0.52).
SurfaceMesh floor_with_post() {
  SurfaceMesh mesh;
  for (int i = 0; i < 40; ++i)
    for (int j = 0; j < 20; ++j)
      mesh.vertices.emplace_back(0.05F * static_cast<float>(i) + 0.02F, 0.05F * static_cast<float>(j) + 0.02F, 0.0F);
  for (int k = 1; k < 40; ++k) mesh.vertices.emplace_back(1.52F, 0.52F, 0.02F * static_cast<float>(k));
  for (int k = 0; k < 20; ++k) mesh.vertices.emplace_back(0.52F, 0.52F, 1.8F + 0.02F * static_cast<float>(k));  // lamp
  return mesh;
}

uint8_t cell_at(const OccupancyGrid& grid, double x, double y) {
  const int column = static_cast<int>(std::floor((x - grid.origin_x) / grid.cell));
  const int row = grid.cells.height() - 1 - static_cast<int>(std::floor((y - grid.origin_y) / grid.cell));
  return grid.cells(column, row);
}

TEST(OccupancyGrid, PostIsOccupiedLampIsNotFloorIsFreeRestIsUnknown) {
  const OccupancyGrid grid = make_occupancy_grid(floor_with_post(), {}, {}, {}, {});
  EXPECT_NEAR(grid.origin_x, -0.05, 1e-9);
  EXPECT_NEAR(grid.origin_y, -0.05, 1e-9);
  EXPECT_EQ(cell_at(grid, 1.52, 0.52), OccupancyGrid::kOccupied);
  EXPECT_EQ(cell_at(grid, 0.52, 0.52), OccupancyGrid::kFree);
  EXPECT_EQ(cell_at(grid, 0.11, 0.91), OccupancyGrid::kFree);
  EXPECT_EQ(grid.cells(0, 0), OccupancyGrid::kUnknown);
  int occupied = 0;
  for (size_t i = 0; i < grid.cells.size(); ++i) occupied += grid.cells.data()[i] == OccupancyGrid::kOccupied;
  EXPECT_EQ(occupied, 1);
}

TEST(OccupancyGrid, RaysMakeCellsFreeUpToWhatTheyHit) {
  // A camera 0.5 m above the floor at the origin looks along +x (its y is down, -z of the world) at a wall 2 m ahead.
  SurfaceMesh mesh;
  for (int k = 0; k < 50; ++k) mesh.vertices.emplace_back(2.01F, 0.01F, 0.02F * static_cast<float>(k));
  const ViewCamera camera{40, 30, 40, 40, 19.5, 14.5};
  DepthView view;
  view.depth = Image<uint16_t>(40, 30, static_cast<uint16_t>(2.01 * DepthView::kUnitsPerMetre));
  Eigen::Matrix3d world_from_cam;
  world_from_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  const Rigid3 pose(Eigen::Quaterniond(world_from_cam), Eigen::Vector3d(0, 0, 0.5));
  const PlacedView placed{&view, pose.inverse()};
  const OccupancyGrid grid = make_occupancy_grid(mesh, {&placed, 1}, camera, {}, {});
  EXPECT_EQ(cell_at(grid, 2.01, 0.01), OccupancyGrid::kOccupied);
  for (double x = 0.1; x < 1.9; x += 0.1) EXPECT_EQ(cell_at(grid, x, -0.01), OccupancyGrid::kFree) << x;
}

TEST(OccupancyGrid, FilesAreReadBackAsMapServerDoes) {
  OccupancyGrid grid;
  grid.cell = 0.05;
  grid.origin_x = -1.25;
  grid.origin_y = 0.5;
  grid.cells = Image<uint8_t>(3, 2, OccupancyGrid::kUnknown);
  grid.cells(2, 0) = OccupancyGrid::kOccupied;
  grid.cells(0, 1) = OccupancyGrid::kFree;
  const std::string pgm = occupancy_pgm(grid);
  std::istringstream in(pgm);
  std::string magic;
  int width = 0, height = 0, largest = 0;
  in >> magic >> width >> height >> largest;
  in.get();
  EXPECT_EQ(magic, "P5");
  EXPECT_EQ(width, 3);
  EXPECT_EQ(height, 2);
  EXPECT_EQ(largest, 255);
  const std::string pixels = pgm.substr(static_cast<size_t>(in.tellg()));
  ASSERT_EQ(pixels.size(), 6u);
  // occ = (255 - p) / 255: above occupied_thresh, below free_thresh, or between.
  const auto occ = [&](size_t i) { return (255.0 - static_cast<unsigned char>(pixels[i])) / 255.0; };
  EXPECT_GT(occ(2), 0.65);
  EXPECT_LT(occ(3), 0.196);
  EXPECT_GT(occ(0), 0.196);
  EXPECT_LT(occ(0), 0.65);
  const std::string yaml = occupancy_yaml(grid, "occupancy.pgm");
  EXPECT_NE(yaml.find("image: occupancy.pgm\n"), std::string::npos);
  EXPECT_NE(yaml.find("resolution: 0.05\n"), std::string::npos);
  EXPECT_NE(yaml.find("origin: [-1.2500, 0.5000, 0.0]\n"), std::string::npos);
  EXPECT_NE(yaml.find("negate: 0\n"), std::string::npos);
}

TEST(OccupancyGrid, EmptyWithoutAMesh) {
  EXPECT_TRUE(make_occupancy_grid({}, {}, {}, {}, {}).cells.empty());
}

}  // namespace
}  // namespace dkb
