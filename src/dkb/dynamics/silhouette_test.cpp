// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/silhouette.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

void fill(DepthImage* depth, int x0, int y0, int x1, int y1, float z) {
  for (int y = y0; y < y1; ++y)
    for (int x = x0; x < x1; ++x) (*depth)(x, y) = z;
}

// A person at 1.5 m before a wall at 3 m: pixels 60 ... 99, 20 ... 99 of 160 x 120.
DepthImage person_before_wall() {
  DepthImage depth(160, 120, 3.0f);
  fill(&depth, 60, 20, 100, 100, 1.5f);
  return depth;
}

MoverMask silhouette_in(const DepthImage& depth, const Box& box) {
  return silhouettes(depth, std::vector<Detection>{{"person", box, 1}}, {}, {}).mask;
}

TEST(Silhouette, HoldsThePersonAndARimButNotTheWallBesideIt) {
  const MoverMask mask = silhouette_in(person_before_wall(), {40, 10, 80, 100});
  EXPECT_EQ(mask.cells.width(), 40);
  EXPECT_EQ(mask.cells.height(), 30);
  for (int y = 20; y < 100; ++y)
    for (int x = 60; x < 100; ++x) ASSERT_TRUE(mask.at(static_cast<float>(x), static_cast<float>(y))) << x << " " << y;
  EXPECT_TRUE(mask.at(57, 60));   // one cell of rim
  EXPECT_FALSE(mask.at(55, 60));  // wall inside the box
  EXPECT_FALSE(mask.at(104, 60));
  EXPECT_FALSE(mask.at(80, 15));
}

TEST(Silhouette, AnArmReachingForwardHangsTogetherWithTheBody) {
  DepthImage depth = person_before_wall();
  for (int x = 100; x < 116; ++x) fill(&depth, x, 40, x + 1, 52, 1.5f - 0.005f * static_cast<float>(x - 99));
  EXPECT_TRUE(silhouette_in(depth, {40, 10, 80, 100}).at(112, 46));
}

TEST(Silhouette, AnArmFarBehindTheBodyEndsWithinTheBoxAndIsPartOfThePerson) {
  DepthImage depth = person_before_wall();
  fill(&depth, 100, 30, 112, 70, 2.05f);  // 55 cm behind the chest, no depths between
  const MoverMask mask = silhouette_in(depth, {40, 10, 80, 100});
  EXPECT_TRUE(mask.at(108, 50));
  EXPECT_FALSE(mask.at(118, 50)) << "the wall beside the arm";
}

TEST(Silhouette, WhatGoesOnBeyondTheBoxIsNoLimb) {
  DepthImage depth = person_before_wall();
  fill(&depth, 100, 70, 150, 90, 2.05f);  // a table as far away as that arm
  EXPECT_FALSE(silhouette_in(depth, {40, 10, 80, 100}).at(108, 80));
}

TEST(Silhouette, WhatStandsApartFromTheBodyIsNoLimb) {
  DepthImage depth = person_before_wall();
  fill(&depth, 108, 50, 116, 70, 2.05f);  // a vase, some wall between
  EXPECT_FALSE(silhouette_in(depth, {40, 10, 80, 100}).at(112, 60));
}

TEST(Silhouette, ALimbMayBeCutByTheBorderOfTheImage) {
  DepthImage depth(160, 120, 3.0f);
  fill(&depth, 110, 20, 150, 100, 1.5f);
  fill(&depth, 150, 30, 160, 70, 2.05f);
  EXPECT_TRUE(silhouette_in(depth, {90, 10, 70, 100}).at(156, 50));
}

TEST(Silhouette, WhatLiesFartherInDepthIsNotPartOfThePerson) {
  DepthImage depth(240, 120, 3.0f);
  fill(&depth, 100, 20, 140, 100, 1.5f);
  // A ramp behind the person's side: its steps are as small as those of one surface, but it leads away. Of it 30 px are
  // in the box's core, so that the layer is in the middle of 1.5 and 1.845 m.
  for (int x = 140; x < 220; ++x) fill(&depth, x, 20, x + 1, 100, 1.5f + 0.0115f * static_cast<float>(x - 139));
  const MoverMask mask = silhouette_in(depth, {20, 10, 200, 100});
  EXPECT_TRUE(mask.at(190, 60));   // 0.41 m behind the layer
  EXPECT_FALSE(mask.at(215, 60));  // 0.70 m
}

TEST(Silhouette, TheNearerOfTwoHeavyLayersIsTheObject) {
  DepthImage depth(160, 120, 3.0f);
  for (int x = 60; x < 78; ++x)
    fill(&depth, x, 20, x + 1, 100, 1.45f + 0.005f * static_cast<float>(x - 60));  // less than half of the core
  const MoverMask mask = silhouette_in(depth, {50, 10, 60, 100});
  EXPECT_TRUE(mask.at(70, 60));
  EXPECT_FALSE(mask.at(100, 60));
}

// At 6 m a layer of 15% of the depth would hold the wall as well, and lie between the two.
TEST(Silhouette, WhoStandsFarAwayIsToldFromTheWallBehind) {
  DepthImage depth(160, 120, 7.2f);
  fill(&depth, 70, 20, 90, 100, 6.0f);
  const MoverMask mask = silhouette_in(depth, {62, 16, 40, 88});
  EXPECT_TRUE(mask.at(80, 30));
  EXPECT_TRUE(mask.at(80, 90));
  EXPECT_FALSE(mask.at(98, 60));
}

TEST(Silhouette, ABodyIsWhatLiesNearerToTheMiddleThanToTheSurroundings) {
  DepthImage depth = person_before_wall();
  fill(&depth, 84, 70, 160, 90, 1.5f);  // a table at the person's depth, from his hip to beyond the box
  const Silhouettes found = silhouettes(depth, std::vector<Detection>{{"person", {40, 10, 80, 100}, 1}}, {}, {});
  EXPECT_TRUE(found.body.at(80, 30));
  EXPECT_TRUE(found.body.at(80, 90));
  EXPECT_TRUE(found.mask.at(114, 80)) << "no depth tells the table from the person";
  EXPECT_FALSE(found.body.at(114, 80));
}

TEST(Silhouette, AThinThingInFrontIsNotTheObject) {
  DepthImage depth = person_before_wall();
  fill(&depth, 80, 0, 83, 120, 0.7f);  // a pole
  EXPECT_TRUE(silhouette_in(depth, {60, 20, 40, 80}).at(66, 60));
}

TEST(Silhouette, HolesInThePersonAreFilled) {
  DepthImage depth = person_before_wall();
  fill(&depth, 76, 56, 84, 64, 0);
  EXPECT_TRUE(silhouette_in(depth, {60, 20, 40, 80}).at(80, 60));
}

TEST(Silhouette, HolesInTheWallAreNot) {
  DepthImage depth = person_before_wall();
  fill(&depth, 120, 40, 128, 48, 0);
  EXPECT_FALSE(silhouette_in(depth, {40, 10, 110, 100}).at(124, 44));
}

TEST(Silhouette, ABoxWithoutDepthIsTakenWhole) {
  const MoverMask mask = silhouette_in(DepthImage(160, 120), {40, 20, 40, 60});
  EXPECT_TRUE(mask.at(41, 21));
  EXPECT_TRUE(mask.at(79, 79));
  EXPECT_FALSE(mask.at(100, 50));
}

TEST(Silhouette, NoBoxesNoMask) {
  EXPECT_TRUE(silhouettes(person_before_wall(), {}, {}, {}).mask.empty());
}

TEST(Silhouette, BoxesBeyondTheImageAreHarmless) {
  EXPECT_NO_THROW(silhouette_in(person_before_wall(), {-50, -50, 60, 60}));
  EXPECT_NO_THROW(silhouette_in(person_before_wall(), {150, 110, 500, 500}));
  EXPECT_NO_THROW(silhouette_in(person_before_wall(), {300, 300, 10, 10}));
  EXPECT_NO_THROW(silhouette_in(person_before_wall(), {80, 60, 0, 0}));
}

TEST(Silhouette, TheMasksOfSeveralBoxesAreUnited) {
  DepthImage depth = person_before_wall();
  fill(&depth, 110, 20, 140, 100, 2.0f);
  const std::vector<Detection> boxes = {{"person", {60, 20, 40, 80}, 1}, {"person", {110, 20, 30, 80}, 1}};
  const MoverMask mask = silhouettes(depth, boxes, {}, {}).mask;
  EXPECT_TRUE(mask.at(80, 60));
  EXPECT_TRUE(mask.at(125, 60));
  EXPECT_FALSE(mask.at(30, 60));
}

// A row of four mask cells of 4 px, the last two of them of the body.
Silhouettes boxed_row() {
  Silhouettes boxed;
  boxed.mask.cell = boxed.body.cell = 4;
  boxed.mask.cells = Image<uint8_t>(4, 1, 255);
  boxed.body.cells = Image<uint8_t>(4, 1);
  boxed.body.cells(2, 0) = boxed.body.cells(3, 0) = 255;
  return boxed;
}

TEST(StillCells, OfABodyOnlyWhatAViewWitnessedIsTakenOut) {
  StillCells still{4, Image<uint8_t>(4, 1)};
  still.kinds(1, 0) = still.kinds(2, 0) = StillCells::unrefuted;
  still.kinds(3, 0) = StillCells::witnessed;
  const Silhouettes left = without_still(boxed_row(), still);
  EXPECT_NE(left.mask.cells(0, 0), 0) << "it moves, or nobody knows";
  EXPECT_EQ(left.mask.cells(1, 0), 0) << "beside the body nothing speaks for motion";
  EXPECT_NE(left.mask.cells(2, 0), 0);
  EXPECT_NE(left.body.cells(2, 0), 0);
  EXPECT_EQ(left.mask.cells(3, 0), 0);
  EXPECT_EQ(left.body.cells(3, 0), 0);
}

TEST(StillCells, CellsOfAnotherSizeCountWhereTheyLie) {
  StillCells still{8, Image<uint8_t>(2, 1)};
  still.kinds(0, 0) = StillCells::witnessed;
  const Silhouettes left = without_still(boxed_row(), still);
  for (int x = 0; x < 4; ++x) EXPECT_EQ(left.mask.cells(x, 0) == 0, x < 2) << x;
}

TEST(StillCells, NothingIsKnownWithoutMotionSegmentation) {
  EXPECT_EQ(without_still(boxed_row(), {}).mask.cells, boxed_row().mask.cells);
}

}  // namespace
}  // namespace dkb
