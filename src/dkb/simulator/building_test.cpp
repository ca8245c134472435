// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "dkb/simulator/rasteriser.h"
#include "dkb/simulator/route.h"
#include "dkb/simulator/scene.h"
#include "dkb/simulator/sensor.h"
#include "dkb/simulator/simulator.h"

namespace dkb::sim {
namespace {

using Eigen::Vector2d;

Scene building(uint64_t seed = 1) {
  SceneRequest request;
  request.name = "building";
  request.seed = seed;
  return build_scene(request);
}

double heading(const Rigid3& scene_from_cam) {
  const Eigen::Vector3d axis = scene_from_cam.rotation * Eigen::Vector3d::UnitZ();
  return std::atan2(axis.y(), axis.x());
}

TEST(Route, RoundsCornersAndTurnsNoFasterThanAllowed) {
  // 4 m east, a quarter of a circle of 1 m, 2 m north.
  const Route route({{{0, 0}, 0}, {{5, 0}, 1}, {{5, 3}, 0}});
  EXPECT_NEAR(route.length(), 4 + std::numbers::pi / 2 + 2, 1e-9);
  EXPECT_NEAR((route.at(4 + std::numbers::pi / 4).position - Vector2d(4 + std::sqrt(0.5), 1 - std::sqrt(0.5))).norm(),
              0, 1e-9);
  EXPECT_NEAR(route.at(4 + std::numbers::pi / 4).heading, std::numbers::pi / 4, 1e-9);
  const std::vector<TimedPose> poses = route.drive(15, {0.5, 0.6, 1.1, -0.1});
  EXPECT_EQ(poses.front().time, 0);
  EXPECT_NEAR(poses.back().time, 15, 1e-6);
  EXPECT_NEAR((poses.back().world_from_cam.translation - Eigen::Vector3d(5, 3, 1.1)).norm(), 0, 1e-9);
  for (size_t i = 1; i < poses.size(); ++i) {
    const double dt = poses[i].time - poses[i - 1].time;
    const double turned = heading(poses[i].world_from_cam) - heading(poses[i - 1].world_from_cam);
    EXPECT_LT(turned / dt, 0.52);
  }
}

TEST(Building, HasTenRoomsAndPeopleInHalfOfThem) {
  const Scene scene = building();
  int rooms = 0;
  for (const Cell& c : scene.cells) rooms += c.area.x1 - c.area.x0 > 4 && c.area.y1 - c.area.y0 > 4;
  EXPECT_EQ(rooms, 10);
  EXPECT_FALSE(scene.glass.patches.empty());
  std::set<size_t> with_people;
  for (const Mover& m : scene.movers)
    for (double t = 0; t < 200; t += 20) with_people.insert(cell_at(scene.cells, m.track.at(t).position));
  EXPECT_EQ(with_people.size(), 5U);
}

TEST(Building, WayIsTwoHundredMetresInThreeLoops) {
  const Scene scene = building();
  ASSERT_EQ(scene.frames, 6000);
  double length = 0, fastest_turn = 0;
  std::vector<Rigid3> poses;
  for (int i = 0; i < 6000; ++i) {
    poses.push_back(scene.path(i / 30.0));
    if (i == 0) continue;
    length += (poses.back().translation - poses[poses.size() - 2].translation).head<2>().norm();
    fastest_turn = std::max(
        fastest_turn,
        std::abs(std::remainder(heading(poses.back()) - heading(poses[poses.size() - 2]), 2 * std::numbers::pi)) * 30);
  }
  EXPECT_NEAR(length, 200, 10);
  EXPECT_LT(fastest_turn, 1.25);  // the robot's 60 degrees a second, and the camera's tremor
  // Where the robot is again at a place, looking the same way, more than 20 s later; runs of such frames are one
  // return.
  int returns = 0, last = -1000;
  for (int i = 0; i < 6000; i += 6)
    for (int k = 0; k + 600 < i; k += 6) {
      const size_t a = static_cast<size_t>(i), b = static_cast<size_t>(k);
      if ((poses[a].translation - poses[b].translation).norm() > 0.4 ||
          std::abs(std::remainder(heading(poses[a]) - heading(poses[b]), 2 * std::numbers::pi)) > 0.3)
        continue;
      returns += i - last > 600;
      last = i;
      break;
    }
  EXPECT_EQ(returns, 3);
}

TEST(Building, CellsLeaveOutNothingThatIsSeen) {
  const Scene scene = building(3);
  CameraModel camera;
  camera.width = 160, camera.height = 120, camera.fx = camera.fy = 131, camera.cx = 79.5, camera.cy = 59.5;
  Rasteriser rasteriser(camera);
  size_t drawn = 0, all = 0;
  for (double t = 0; t < 199; t += 7.3) {
    const Rigid3 pose = scene.path(t);
    const std::vector<bool> seen = visible_cells(scene.cells, camera, pose, 0.02);
    DrawList some, every;
    for (size_t i = 0; i < scene.cells.size(); ++i) {
      every.add(scene.cells[i].furnishing.surfaces);
      if (seen[i]) some.add_visible(scene.cells[i].furnishing.surfaces, camera, pose.inverse(), 0.02);
    }
    GeometryImage a, b;
    rasteriser.draw(some, pose.inverse(), Vector2d::Zero(), {0, camera.height}, &a);
    rasteriser.draw(every, pose.inverse(), Vector2d::Zero(), {0, camera.height}, &b);
    EXPECT_EQ(a.inverse_depth, b.inverse_depth) << t << " s";
    drawn += some.patches.size();
    all += every.patches.size();
  }
  EXPECT_LT(drawn * 4, all);
}

TEST(Building, SameSeedSameFrame) {
  SimulatorOptions o;
  o.scene = "building";
  o.width = 160;
  o.height = 120;
  const Simulator a(o), b(o);
  o.seed = 2;
  const Simulator other(o);
  const SimulatedFrame x = a.render_without_true_depth(1900), y = b.render_without_true_depth(1900);
  EXPECT_EQ(x.image.colour, y.image.colour);
  EXPECT_EQ(x.image.depth, y.image.depth);
  EXPECT_NE(x.image.colour, other.render_without_true_depth(1900).image.colour);
}

TEST(Building, RobotMeetsNobody) {
  SimulatorOptions o;
  o.scene = "building";
  for (o.seed = 1; o.seed <= 2; ++o.seed) {
    const Simulator s(o);
    double nearest = 1e9;
    for (double t = 0; t < 200; t += 0.1) nearest = std::min(nearest, s.nearest_mover(t));
    EXPECT_GT(nearest, 0.5);
  }
}

TEST(Glass, TakesTheDepthBehindItAtASlantAndWhereItReflects) {
  Image<float> pane(3, 1), cosine(3, 1), behind(3, 1), grey(3, 1);
  for (int x = 0; x < 3; ++x) pane(x, 0) = 0.5F, behind(x, 0) = 0.25F, grey(x, 0) = 200;
  cosine(0, 0) = 0.9F, cosine(1, 0) = 0.25F, cosine(2, 0) = 1.0F;
  look_through(pane, cosine, behind, &grey);
  EXPECT_NEAR(grey(0, 0), 120, 1e-3);
  EXPECT_EQ(grey(1, 0), 0);
  EXPECT_EQ(grey(2, 0), 0);
  look_through(behind, cosine, pane, &grey);  // what stands before the glass does not notice it
  EXPECT_NEAR(grey(0, 0), 120, 1e-3);
}

}  // namespace
}  // namespace dkb::sim
