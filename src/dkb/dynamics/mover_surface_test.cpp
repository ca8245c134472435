// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_surface.h"

#include <gtest/gtest.h>

#include "dkb/dynamics/mover_test_scene.h"

namespace dkb {
namespace {

// Points of a person 0.4 m wide and 1.2 m tall, 2 m before the camera.
MoverSurface person() {
  MoverSurface surface;
  for (double y = -0.6; y <= 0.6; y += 0.15)
    for (double x = -0.2; x <= 0.2; x += 0.1) surface.points_in_world.emplace_back(x, y, 2);
  return surface;
}

MoverTestScene scene_with(float z) {
  MoverTestScene scene;
  scene.add(130, 40, 190, 200, z);
  return scene;
}

TEST(MoverSurface, StandsWhereTheDepthIsWhatItWas) {
  const MoverTestScene scene = scene_with(2);
  EXPECT_TRUE(person().stands(scene.depth, scene.camera, {}, {}));
}

TEST(MoverSurface, IsGoneWhenTheWallIsSeenThroughIt) {
  const MoverTestScene scene;
  EXPECT_FALSE(person().stands(scene.depth, scene.camera, {}, {}));
}

TEST(MoverSurface, DoesNotStandWhereItIsHidden) {
  const MoverTestScene scene = scene_with(1);
  EXPECT_FALSE(person().stands(scene.depth, scene.camera, {}, {}));
}

TEST(MoverSurface, StandsForACameraThatMoves) {
  MoverTestScene scene;
  scene.add(130 - 63, 40, 190 - 63, 200, 2);  // half a metre to the side
  EXPECT_TRUE(person().stands(scene.depth, scene.camera, {}, {Eigen::Quaterniond::Identity(), {0.5, 0, 0}}));
}

// Who has come nearer has left the place behind him as well.
TEST(MoverSurface, HasLeftAPlaceThatShowsSomethingElse) {
  const auto has_left = [](const MoverTestScene& scene, const Rigid3& world_from_cam = {}) {
    return person().has_left(scene.depth, scene.camera, {}, world_from_cam);
  };
  EXPECT_TRUE(has_left(MoverTestScene()));
  EXPECT_TRUE(has_left(scene_with(1)));
  EXPECT_FALSE(has_left(scene_with(2)));
  EXPECT_FALSE(has_left(MoverTestScene(0.0f))) << "no depth tells nothing";
  EXPECT_FALSE(has_left(MoverTestScene(), {Eigen::Quaterniond::Identity(), {0, 0, 3}})) << "nor does a camera beyond";
}

TEST(MoverSurface, BehindTheCameraNothingStands) {
  const MoverTestScene scene = scene_with(2);
  EXPECT_FALSE(person().stands(scene.depth, scene.camera, {}, {Eigen::Quaterniond::Identity(), {0, 0, 3}}));
}

}  // namespace
}  // namespace dkb
