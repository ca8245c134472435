// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/dense_mapper.h"

#include <gtest/gtest.h>

#include "dkb/dense/dense_test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

using testing::DenseScene;

double time_of(int i) {
  return 100 + 0.1 * i;
}

std::vector<TimedPose> trajectory(int count) {
  std::vector<TimedPose> poses;
  for (int i = 0; i < count; ++i) poses.push_back({time_of(i), testing::scene_pose(i)});
  return poses;
}

DenseMapper mapper_with_views(int count) {
  DenseMapper mapper(testing::scene_camera(), {}, testing::scene_options());
  for (int i = 0; i < count; ++i)
    mapper.add_keyframe(i, DenseScene().draw(testing::scene_camera(), testing::scene_pose(i), time_of(i)), time_of(i),
                        {});
  return mapper;
}

TEST(DenseMapper, MapsTheSceneWithItsFloorAndObstacles) {
  const DenseMap map = mapper_with_views(8).build(trajectory(8), 1);
  EXPECT_EQ(map.views, 8);
  EXPECT_GT(map.mesh.triangles.size(), 10000u);
  ASSERT_TRUE(map.grid);
  const Rigid3& floor_from_world = map.grid->floor_from_world;
  EXPECT_NEAR((floor_from_world * Eigen::Vector3d(0.2, 1.2, 2.5)).z(), 0, 0.01);
  EXPECT_NEAR((floor_from_world * Eigen::Vector3d(0, 0, 0)).z(), 1.2, 0.01);
  const auto cell_of = [&](const Eigen::Vector3d& world) {
    const Eigen::Vector3d p = floor_from_world * world;
    return map.grid->cells(
        static_cast<int>(std::floor((p.x() - map.grid->origin_x) / map.grid->cell)),
        map.grid->cells.height() - 1 - static_cast<int>(std::floor((p.y() - map.grid->origin_y) / map.grid->cell)));
  };
  EXPECT_EQ(cell_of({0.3, 0.5, 1.62}), OccupancyGrid::kOccupied);  // the ball's front
  EXPECT_EQ(cell_of({-0.3, 1.2, 2.3}), OccupancyGrid::kFree);
}

TEST(DenseMapper, AMountTellsWhereUpIsForCamerasThatLookDown) {
  // Half a right angle down, and on its side: without a mount up is taken for that of the image.
  for (const Eigen::Vector3d& turn : {Eigen::Vector3d(-0.7854, 0, 0), Eigen::Vector3d(0, 0, 1.5708)}) {
    const Eigen::Quaterniond tilt = testing::scene_pose(0).rotation.conjugate() * rotation_from_vector(turn);
    const Eigen::Quaterniond base_from_optical(0.5, -0.5, 0.5, -0.5);
    DenseMapper mapper(testing::scene_camera(), {}, testing::scene_options());
    std::vector<TimedPose> poses;
    for (int i = 0; i < 8; ++i) {
      const Rigid3 at(testing::scene_pose(i).rotation * tilt, testing::scene_pose(i).translation);
      poses.push_back({time_of(i), at});
      mapper.add_keyframe(i, DenseScene().draw(testing::scene_camera(), at, time_of(i)), time_of(i), {});
    }
    EXPECT_FALSE(mapper.build(poses, 1).grid);
    const Rigid3 mount(base_from_optical * rotation_from_vector(turn), {0.1, 0, 0.4});
    const DenseMap map = mapper.build(poses, 1, mount);
    ASSERT_TRUE(map.grid);
    EXPECT_NEAR((map.grid->floor_from_world * Eigen::Vector3d(0.2, 1.2, 2)).z(), 0, 0.01);
    EXPECT_NEAR((map.grid->floor_from_world * Eigen::Vector3d(0, 0, 0)).z(), 1.2, 0.01);
  }
}

TEST(DenseMapper, SameInputGivesTheSameBytes) {
  const DenseMap a = mapper_with_views(5).build(trajectory(5), 1), b = mapper_with_views(5).build(trajectory(5), 1);
  EXPECT_EQ(mesh_ply(a.mesh), mesh_ply(b.mesh));
  ASSERT_TRUE(a.grid && b.grid);
  EXPECT_EQ(occupancy_pgm(*a.grid), occupancy_pgm(*b.grid));
  EXPECT_EQ(occupancy_yaml(*a.grid, "x"), occupancy_yaml(*b.grid, "x"));
}

TEST(DenseMapper, ACopyKeepsWhatItHadWhileTheOriginalGoesOn) {
  DenseMapper mapper = mapper_with_views(4);
  const std::string before = mesh_ply(mapper.build(trajectory(5), 1).mesh);
  const DenseMapper copy = mapper;
  const Camera camera = testing::scene_camera();
  mapper.remove_movers(2, {.cell = 4, .cells = Image<uint8_t>((camera.width + 3) / 4, (camera.height + 3) / 4, 255)});
  mapper.add_keyframe(4, DenseScene().draw(camera, testing::scene_pose(4), time_of(4)), time_of(4), {});
  EXPECT_EQ(mesh_ply(copy.build(trajectory(5), 1).mesh), before);
  EXPECT_NE(mesh_ply(mapper.build(trajectory(5), 1).mesh), before);
}

TEST(DenseMapper, FollowsTheFinishedTrajectory) {
  // The whole map moves with the poses.
  const Rigid3 moved(rotation_from_vector({0, 0.1, 0}), {1, 0, 0.5});
  std::vector<TimedPose> poses = trajectory(6);
  for (TimedPose& p : poses) p.world_from_cam = moved * p.world_from_cam;
  const DenseMap map = mapper_with_views(6).build(poses, 1);
  const DenseScene scene;
  std::vector<double> errors;
  for (const auto& v : map.mesh.vertices) errors.push_back(scene.distance(moved.inverse() * v.cast<double>()));
  ASSERT_GT(errors.size(), 5000u);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.004);
}

TEST(DenseMapper, DepthTakesItsPoseAtItsOwnTime) {
  // Depth images half way between two poses.
  DenseMapper mapper(testing::scene_camera(), {}, testing::scene_options());
  for (int i = 0; i < 6; ++i) {
    const Rigid3 a = testing::scene_pose(i), b = testing::scene_pose(i + 1);
    const Rigid3 middle(a.rotation.slerp(0.5, b.rotation), 0.5 * (a.translation + b.translation));
    RgbdImage image = DenseScene().draw(testing::scene_camera(), middle, time_of(i));
    image.depth_timestamp += 0.05;
    mapper.add_keyframe(i, image, image.depth_timestamp, {});
  }
  const DenseMap map = mapper.build(trajectory(7), 1);
  std::vector<double> errors;
  for (const auto& v : map.mesh.vertices) errors.push_back(DenseScene().distance(v.cast<double>()));
  ASSERT_GT(errors.size(), 5000u);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.004);
}

TEST(DenseMapper, MaskedMoversLeaveNoTraceWhenKnownInTimeOrLate) {
  const auto build = [](bool at_once, bool late) {
    DenseMapper mapper(testing::scene_camera(), {}, testing::scene_options());
    for (int i = 0; i < 5; ++i) {
      DenseScene scene;
      scene.person.emplace(-0.4, 2.2);
      const RgbdImage with = scene.draw(testing::scene_camera(), testing::scene_pose(i), time_of(i));
      const RgbdImage without = DenseScene().draw(testing::scene_camera(), testing::scene_pose(i), time_of(i));
      MoverMask mask;
      mask.cells = Image<uint8_t>(40, 30);
      for (int y = 0; y < 120; ++y)
        for (int x = 0; x < 160; ++x)
          if (with.depth(x, y) != without.depth(x, y)) mask.cells(x / 4, y / 4) = 255;
      mapper.add_keyframe(i, with, with.depth_timestamp, at_once ? mask : MoverMask{});
      if (late) mapper.remove_movers(i, mask);
    }
    size_t on_person = 0;
    for (const auto& v : mapper.build(trajectory(5), 1).mesh.vertices)
      on_person += std::abs(std::hypot(v.x() + 0.4F, v.z() - 2.2F) - 0.25F) < 0.05F && v.y() < 1.1F ? 1 : 0;
    return on_person;
  };
  EXPECT_GT(build(false, false), 200u);
  EXPECT_EQ(build(true, false), 0u);
  EXPECT_EQ(build(false, true), 0u);
}

TEST(DenseMapper, NothingFromNothing) {
  const DenseMapper mapper(testing::scene_camera(), {}, {});
  const DenseMap map = mapper.build({}, 1);
  EXPECT_TRUE(map.mesh.triangles.empty());
  EXPECT_FALSE(map.grid);
  EXPECT_EQ(mapper_with_views(2).build({}, 1).views, 0);
}

TEST(DenseMapper, ViewsFarFromAnyPoseAreLeftOut) {
  std::vector<TimedPose> poses = trajectory(4);
  for (TimedPose& p : poses) p.timestamp += 0.05;  // the last is 0.05, 0.15, 0.25 s from views 4, 5, 6
  EXPECT_EQ(mapper_with_views(8).build(poses, 1).views, 6);
}

}  // namespace
}  // namespace dkb
