// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_observer.h"

#include <gtest/gtest.h>

#include "dkb/detection/mask_folder.h"
#include "dkb/dynamics/mover_test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

std::vector<MoverObservation> observe(const MoverTestScene& scene, const Rigid3& world_from_cam = {}) {
  return MoverObserver(scene.camera).observe(scene.depth, scene.mask, scene.boxes, world_from_cam);
}

TEST(MoverObserver, ThePositionIsTheMedianOfTheVisibleSurface) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].class_name, "person");
  EXPECT_EQ(found[0].box, (Box{100, 40, 60, 160}));
  // Middle cell of 15 columns: pixels 128 ... 131, middle 129.5: (129.5 - 159.5) / 250 * 2 m; of 40 rows the 21st:
  // 121.5.
  EXPECT_NEAR(found[0].position_in_world.x(), -0.24, 1e-6);
  EXPECT_NEAR(found[0].position_in_world.y(), 0.016, 1e-6);
  EXPECT_NEAR(found[0].position_in_world.z(), 2, 1e-6);
  EXPECT_GT(found[0].position_sd, 0);
}

TEST(MoverObserver, DepthsBeyondAllReasonCostNoMemory) {
  MoverTestScene scene;
  scene.camera.depth_max = 1e12;  // a camera file may say so
  scene.add(100, 40, 160, 200, 2);
  for (int y = 40; y < 80; ++y)
    for (int x = 100; x < 160; ++x) scene.depth(x, y) = 1e11f;
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].position_in_world.z(), 2, 1e-6);
}

TEST(MoverObserver, PositionsAreInTheWorld) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  // A quarter turn about y takes z to x and x to -z.
  const Rigid3 world_from_cam(Eigen::Quaterniond(Eigen::AngleAxisd(1.5707963267948966, Eigen::Vector3d::UnitY())),
                              {1, 2, 3});
  const auto found = observe(scene, world_from_cam);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR((found[0].position_in_world - Eigen::Vector3d(1 + 2, 2 + 0.016, 3 + 0.24)).norm(), 0, 1e-5);
}

TEST(MoverObserver, WhatTheMaskLeavesOutIsNotMeasured) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  scene.boxes[0].box = {80, 40, 160, 160};  // mostly wall
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].position_in_world.x(), -0.24, 1e-6);
  EXPECT_NEAR(found[0].position_in_world.z(), 2, 1e-6);
}

TEST(MoverObserver, MaskOnTheWallBesideThePersonDoesNotCount) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  for (int y = 10; y < 50; ++y)
    for (int x = 20; x < 25; ++x) scene.mask.cells(x, y) = 255;
  scene.boxes[0].box = {80, 40, 80, 160};
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].position_in_world.z(), 2, 1e-6);
}

TEST(MoverObserver, OfTwoBoxesEachGetsItsOwnDepth) {
  MoverTestScene scene;
  scene.add(130, 30, 170, 220, 1.5f);
  scene.add(90, 60, 210, 190, 3.0f);  // behind, seen on both sides: its box holds columns of the other's
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0].position_in_world.z(), 1.5, 1e-6);
  EXPECT_NEAR(found[1].position_in_world.z(), 3.0, 1e-6);
}

TEST(MoverObserver, ABoxInsideAnotherGetsWhatTheOtherDoesNotExplain) {
  MoverTestScene scene;
  scene.add(140, 80, 180, 160, 1.5f);
  scene.add(60, 40, 260, 220, 2.5f);
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0].position_in_world.z(), 1.5, 1e-6);
  EXPECT_NEAR(found[1].position_in_world.z(), 2.5, 1e-6);
}

// A mask beside boxes: each of its regions comes with a box of its own.
TEST(MoverObserver, ARegionInABoxWithANameIsNoSecondObject) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  scene.add(200, 40, 260, 200, 3, false);
  const Detection of_the_named{kUnnamedRegion, {98, 40, 64, 164}, 1},
      of_the_other{kUnnamedRegion, {200, 40, 60, 160}, 1};
  scene.boxes.push_back(of_the_named);
  scene.boxes.push_back(of_the_other);
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].class_name, "person");
  EXPECT_EQ(found[1].class_name, kUnnamedRegion);
  EXPECT_NEAR(found[1].position_in_world.z(), 3, 1e-6);
}

TEST(MoverObserver, OneRegionOfTwoPeopleIsInTheBoxesOfBoth) {
  MoverTestScene scene;
  scene.add(100, 40, 140, 200, 2);
  scene.add(130, 80, 180, 230, 3);
  scene.boxes.push_back({kUnnamedRegion, {100, 40, 80, 190}, 1});
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].class_name, "person");
  EXPECT_EQ(found[1].class_name, "person");
}

TEST(MoverObserver, WithoutBoxesRegionsOfOneDepthAreTheObjects) {
  MoverTestScene scene;
  scene.add(100, 40, 140, 200, 2, false);
  scene.add(140, 40, 200, 200, 3, false);  // touches the first in the image
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_TRUE(found[0].class_name.empty());
  EXPECT_EQ(found[0].box, (Box{100, 40, 40, 160}));
  EXPECT_NEAR(found[0].position_in_world.z(), 2, 1e-6);
  EXPECT_NEAR(found[1].position_in_world.z(), 3, 1e-6);
}

TEST(MoverObserver, HolesInTheDepthDoNotCutAnObject) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2, false);
  for (int y = 110; y < 122; ++y)
    for (int x = 90; x < 170; ++x) scene.depth(x, y) = 0;
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].box, (Box{100, 40, 60, 160}));
}

TEST(MoverObserver, TheMaskRoundABoxIsNoObjectOfItsOwn) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  dilate(scene.mask, 1);
  EXPECT_EQ(observe(scene).size(), 1u);
}

TEST(MoverObserver, SpecksAndRegionsWithoutDepthAreLeftOut) {
  MoverTestScene scene;
  scene.add(200, 40, 216, 56, 2, false);  // 16 cells without a box
  EXPECT_TRUE(observe(scene).empty());
  MoverTestScene dark;
  dark.add(100, 40, 160, 200, 2, false);
  dark.depth = DepthImage(320, 240);
  EXPECT_TRUE(observe(dark).empty());
}

TEST(MoverObserver, ABoxWithoutDepthTellsADirection) {
  MoverTestScene dark;
  dark.add(100, 40, 160, 200, 2);
  dark.depth = DepthImage(320, 240);
  const auto found = observe(dark);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_FALSE(found[0].has_depth);
  // Middle (130, 120): (130 - 159.5) / 250, (120 - 119.5) / 250.
  EXPECT_NEAR((found[0].position_in_world - Eigen::Vector3d(-0.118, 0.002, 1)).norm(), 0, 1e-6);
}

std::vector<MoverObservation> observe_expecting(const MoverTestScene& scene, const std::vector<Eigen::Vector3d>& at) {
  std::vector<ExpectedMover> expected;
  for (const Eigen::Vector3d& p : at) expected.push_back({p, 0.01 * Eigen::Matrix3d::Identity()});
  return MoverObserver(scene.camera).observe(scene.depth, scene.mask, scene.boxes, {}, expected);
}

TEST(MoverObserver, NeighboursWhoTouchAreToldApartByWhereTheyAreExpected) {
  MoverTestScene scene;
  scene.add(100, 40, 220, 200, 2, false);  // 0.96 m wide: two people shoulder to shoulder
  EXPECT_EQ(observe(scene).size(), 1u);
  const auto found = observe_expecting(scene, {{-0.24, 0, 2}, {0.24, 0, 2}});
  ASSERT_EQ(found.size(), 2u);
  for (const MoverObservation& o : found) EXPECT_NEAR(o.position_in_world.x(), o.expected == 0 ? -0.24 : 0.24, 0.03);
}

TEST(MoverObserver, PartsOfOneExpectedBodyAreJoined) {
  MoverTestScene scene;
  scene.add(130, 40, 190, 90, 2, false);
  scene.add(130, 130, 190, 200, 2.2f, false);  // a gap of ten cells
  EXPECT_EQ(observe(scene).size(), 2u);
  const auto found = observe_expecting(scene, {{0, 0, 2.1}});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].expected, 0);
  EXPECT_EQ(found[0].box, (Box{128, 40, 60, 160}));
}

TEST(MoverObserver, WhoIsNotExpectedIsNotTakenForWhoIs) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2, false);
  scene.add(230, 40, 290, 200, 2, false);
  const auto found = observe_expecting(scene, {{-0.24, 0, 2}});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].expected, 0);
  EXPECT_EQ(found[1].expected, -1);
}

TEST(MoverObserver, AnEmptyMaskHoldsNothing) {
  MoverTestScene scene;
  scene.add(100, 40, 160, 200, 2);
  scene.mask.cells = {};
  EXPECT_TRUE(observe(scene).empty());
}

TEST(MoverObserver, BoxesAcrossTheBorderAreCut) {
  MoverTestScene scene;
  scene.add(0, 40, 40, 200, 2);
  scene.boxes[0].box = {-30, -20, 70, 400};
  const auto found = observe(scene);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].position_in_world.z(), 2, 1e-6);
}

TEST(MoverObserver, AnImageOfAnotherSizeIsRefused) {
  MoverTestScene scene;
  scene.depth = DepthImage(10, 10);
  EXPECT_THROW(observe(scene), InputError);
}

}  // namespace
}  // namespace dkb
