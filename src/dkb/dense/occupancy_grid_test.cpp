// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/occupancy_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <vector>

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

// A camera 1 m above a floor, pitched 20 degrees down along x, that looks from three places over an edge at x = 2 into
// a stairwell whose ground lies at z = -`drop`, up to a wall at x = 5; `noise` [m] is added to every second depth.
OccupancyGrid stairwell(double drop, double noise = 0) {
  const ViewCamera camera{320, 240, 262, 262, 159.5, 119.5};
  const double pitch = 20 * M_PI / 180;
  const Eigen::Vector3d forward(std::cos(pitch), 0, -std::sin(pitch)), right(0, -1, 0);
  Eigen::Matrix3d rotation;
  rotation << right, forward.cross(right), forward;
  DepthView views[3];
  std::vector<PlacedView> placed;
  for (DepthView& view : views) {
    const Eigen::Vector3d eye(0.1 * static_cast<double>(placed.size()), 0, 1);
    view.depth = Image<uint16_t>(320, 240);
    for (int y = 0; y < 240; ++y)
      for (int x = 0; x < 320; ++x) {
        const Eigen::Vector3d ray = rotation * camera.ray(x, y);
        double z = ray.x() > 0 ? (5 - eye.x()) / ray.x() : 0;
        const bool before_edge = ray.z() < 0 && eye.x() + ray.x() / -ray.z() < 2;
        if (ray.z() < 0) z = before_edge ? 1 / -ray.z() : std::min(z, (1 + drop) / -ray.z());
        view.depth(x, y) = static_cast<uint16_t>((z + (x / 4 % 2) * noise) * DepthView::kUnitsPerMetre);
      }
    placed.push_back({&view, Rigid3(Eigen::Quaterniond(rotation), eye).inverse()});
  }
  SurfaceMesh mesh;  // the floor up to the edge, and the wall
  for (int j = -50; j < 50; ++j) {
    const float y = 0.02F * static_cast<float>(j);
    for (int i = 40; i < 100; ++i) mesh.vertices.emplace_back(0.02F * static_cast<float>(i), y, 0.0F);
    for (int k = -100; k < 100; ++k) mesh.vertices.emplace_back(5.01F, y, 0.02F * static_cast<float>(k));
  }
  DenseOptions options;
  options.max_depth = 10;
  return make_occupancy_grid(mesh, placed, camera, {}, options);
}

// Under the middle column of rays.
uint8_t cell_ahead(const OccupancyGrid& grid, double x) {
  return cell_at(grid, x, -0.01);
}

TEST(OccupancyGrid, ADropIsOccupiedFromItsEdgeOn) {
  const OccupancyGrid grid = stairwell(2);
  for (double x = 1.0; x < 1.99; x += 0.1) EXPECT_EQ(cell_ahead(grid, x), OccupancyGrid::kFree) << x;
  for (double x = 2.3; x < 4.95; x += 0.1) EXPECT_EQ(cell_ahead(grid, x), OccupancyGrid::kOccupied) << x;
}

TEST(OccupancyGrid, AFloorThatIsALittleLowerOrNoisyIsNoDrop) {
  // The one is within obstacle_low; depths of the other are off by 5 cm along rays that fall by less than 1 in 1.
  for (const OccupancyGrid& grid : {stairwell(0.08), stairwell(0, 0.05)})
    for (double x = 1.0; x < 4.9; x += 0.1) EXPECT_EQ(cell_ahead(grid, x), OccupancyGrid::kFree) << x;
}

TEST(OccupancyGrid, TheYamlNamesTheWorldThatItIsIn) {
  OccupancyGrid grid = stairwell(2);
  EXPECT_NE(occupancy_yaml(grid, "o.pgm").find("world of trajectory.txt:"), std::string::npos);
  grid.map = 2;
  EXPECT_NE(occupancy_yaml(grid, "o.pgm").find("world of trajectory_map3.txt:"), std::string::npos);
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
