// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/occupancy_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <sstream>
#include <vector>

namespace dkb {
namespace {

struct Solid {  // [m] edges along the axes of a world with z up
  Eigen::Vector3d low, high;
};

// [m] Along a ray of any length to a solid, in units of the ray; infinity when it passes.
double ray_to(const Solid& solid, const Eigen::Vector3d& eye, const Eigen::Vector3d& ray) {
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 3; ++i) {
    const double a = (solid.low[i] - eye[i]) / ray[i], b = (solid.high[i] - eye[i]) / ray[i];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave ? enter : std::numeric_limits<double>::infinity();
}

// Of a camera that looks along x and so many radians down.
Eigen::Matrix3d world_from_cam(double pitch) {
  const Eigen::Vector3d forward(std::cos(pitch), 0, -std::sin(pitch)), right(0, -1, 0);
  Eigen::Matrix3d rotation;
  rotation << right, forward.cross(right), forward;
  return rotation;
}

// Views of solids on a floor at z = 0, and the grid that they make. The mesh is told apart from what the views show.
class Room {
 public:
  void see(const Eigen::Vector3d& eye, double pitch, double time, const std::vector<Solid>& solids) {
    const Eigen::Matrix3d rotation = world_from_cam(pitch);
    auto& view = views_.emplace_back(std::make_unique<DepthView>());
    view->depth_time = time;
    view->depth = Image<uint16_t>(camera_.width, camera_.height);
    for (int y = 0; y < camera_.height; ++y)
      for (int x = 0; x < camera_.width; ++x) {
        const Eigen::Vector3d ray = rotation * camera_.ray(x, y) + Eigen::Vector3d::Constant(1e-9);
        double z = ray.z() < 0 ? eye.z() / -ray.z() : 12;
        for (const Solid& solid : solids) z = std::min(z, ray_to(solid, eye, ray));
        view->depth(x, y) = static_cast<uint16_t>(std::min(z, 12.0) * DepthView::kUnitsPerMetre);
      }
    placed_.push_back({view.get(), Rigid3(Eigen::Quaterniond(rotation), eye).inverse()});
  }
  OccupancyGrid grid() const {
    SurfaceMesh mesh;  // says how large the grid is
    mesh.vertices = {{0, -2, 0}, {5, 2, 0}};
    return make_occupancy_grid(mesh, placed_, camera_, {}, {});
  }

 private:
  ViewCamera camera_{320, 240, 262, 262, 159.5, 119.5};
  std::vector<std::unique_ptr<DepthView>> views_;
  std::vector<PlacedView> placed_;
};

uint8_t cell_at(const OccupancyGrid& grid, double x, double y) {
  const int column = static_cast<int>(std::floor((x - grid.origin_x) / grid.cell));
  const int row = grid.cells.height() - 1 - static_cast<int>(std::floor((y - grid.origin_y) / grid.cell));
  return grid.cells(column, row);
}

TEST(OccupancyGrid, PostIsOccupiedLampIsNotFloorIsFreeRestIsUnknown) {
  const std::vector<Solid> solids{{{2.02, 0.02, 0}, {2.1, 0.1, 0.8}},  // post
                                  {{2.5, -1, 1.6}, {2.7, -0.5, 2}},    // lamp
                                  {{3.52, -2, 0}, {3.7, 2, 2.5}}};     // wall
  Room room;
  for (int i = 0; i < 3; ++i) room.see({0.1 * i, 0.3, 1}, 0.3, 0.3 * i, solids);
  const OccupancyGrid grid = room.grid();
  EXPECT_NEAR(grid.origin_x, -0.05, 1e-9);
  EXPECT_NEAR(grid.origin_y, -2.05, 1e-9);
  EXPECT_EQ(cell_at(grid, 2.03, 0.03), OccupancyGrid::kOccupied);
  EXPECT_EQ(cell_at(grid, 2.6, -0.7), OccupancyGrid::kFree);
  EXPECT_EQ(cell_at(grid, 2.6, 0.7), OccupancyGrid::kFree);
  EXPECT_EQ(cell_at(grid, 3.53, 0.5), OccupancyGrid::kOccupied);
  EXPECT_EQ(cell_at(grid, 4.6, 0.5), OccupancyGrid::kUnknown);
  EXPECT_EQ(grid.cells(0, 0), OccupancyGrid::kUnknown);
}

TEST(OccupancyGrid, RaysMakeCellsFreeUpToWhatTheyHit) {
  Room room;
  for (int i = 0; i < 2; ++i) room.see({0, 0, 0.5}, 0, 0.3 * i, {{{2.01, -2, 0}, {2.3, 2, 2}}});
  const OccupancyGrid grid = room.grid();
  EXPECT_EQ(cell_at(grid, 2.03, 0.03), OccupancyGrid::kOccupied);
  for (double x = 0.1; x < 1.9; x += 0.1) EXPECT_EQ(cell_at(grid, x, -0.01), OccupancyGrid::kFree) << x;
}

// Over a table one sees the floor and the wall behind it, and its top at so flat an angle that it is in no mesh.
TEST(OccupancyGrid, ATableIsNotFreeThoughRaysPassAboveIt) {
  const std::vector<Solid> solids{{{1.5, -1, 0.72}, {2.3, 1, 0.75}}, {{4, -2, 0}, {4.2, 2, 2.5}}};
  Room room;
  for (int i = 0; i < 5; ++i) room.see({0, 0.05 * i, 1.1}, 0.2, 0.3 * i, solids);
  const OccupancyGrid grid = room.grid();
  for (double y = -0.4; y < 0.5; y += 0.2) {
    EXPECT_EQ(cell_at(grid, 1.1, y), OccupancyGrid::kFree) << y;
    for (double x = 1.52; x < 2.27; x += 0.05)
      EXPECT_EQ(cell_at(grid, x, y), OccupancyGrid::kOccupied) << x << ' ' << y;
  }
}

TEST(OccupancyGrid, WhoWalksThroughIsNoObstacleOnceSeenThrough) {
  const Solid wall{{4, -2, 0}, {4.2, 2, 2.5}}, somebody{{2.02, -0.2, 0}, {2.3, 0.2, 1.7}};
  Room shortly, left, stands;
  for (int i = 0; i < 12; ++i) {
    // There for 0.1 s, and nothing of the place seen afterwards; there for 0.5 s, and gone for 1.5; there for good.
    if (i < 2) shortly.see({0, 0, 1}, 0.2, 0.1 * i, {wall, somebody});
    left.see({0, 0, 1}, 0.2, 0.25 * i, i < 3 ? std::vector<Solid>{wall, somebody} : std::vector<Solid>{wall});
    stands.see({0, 0, 1}, 0.2, 0.25 * i, i < 3 ? std::vector<Solid>{wall} : std::vector<Solid>{wall, somebody});
  }
  EXPECT_EQ(cell_at(shortly.grid(), 2.03, 0.03), OccupancyGrid::kUnknown);
  EXPECT_EQ(cell_at(left.grid(), 2.03, 0.03), OccupancyGrid::kFree);
  EXPECT_EQ(cell_at(stands.grid(), 2.03, 0.03), OccupancyGrid::kOccupied);
}

// A camera 1 m above a floor, pitched 20 degrees down along x, that looks from three places over an edge at x = 2 into
// a stairwell whose ground lies at z = -`drop`, up to a wall at x = 5; `noise` [m] is added to every second depth.
OccupancyGrid stairwell(double drop, double noise = 0) {
  const ViewCamera camera{320, 240, 262, 262, 159.5, 119.5};
  const Eigen::Matrix3d rotation = world_from_cam(20 * M_PI / 180);
  DepthView views[3];
  std::vector<PlacedView> placed;
  for (DepthView& view : views) {
    const Eigen::Vector3d eye(0.1 * static_cast<double>(placed.size()), 0, 1);
    view.depth_time = 0.3 * static_cast<double>(placed.size());
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
