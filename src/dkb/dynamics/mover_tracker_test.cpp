// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/mover_tracker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dkb/dynamics/mover_test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr double kFrameTime = 1 / 30.0;  // [s]

// A person 0.5 m wide and 1.4 m tall whose middle is at (x, 0, z) before the camera.
void add_person(double x, double z, MoverTestScene* scene, bool with_box = true) {
  const auto column = [&](double m) { return static_cast<int>(std::lround(250 * m / z + 159.5)); };
  const int half_height = static_cast<int>(std::lround(250 * 0.7 / z));
  scene->add(std::max(0, column(x - 0.25)), std::max(0, 120 - half_height), std::min(320, column(x + 0.25)),
             std::min(240, 120 + half_height), static_cast<float>(z), with_box);
}

std::vector<Mover> show(MoverTracker* tracker, double time, const MoverTestScene& scene,
                        const Rigid3& world_from_cam = {}) {
  return tracker->update(tracker->look(time, scene.depth, scene.mask, scene.boxes, world_from_cam), scene.depth,
                         world_from_cam);
}

MoverTestScene one_person(double x, double z) {
  MoverTestScene scene;
  add_person(x, z, &scene);
  return scene;
}

TEST(MoverTracker, TheThirdObservationGivesAnId) {
  MoverTracker tracker(MoverTestScene().camera, {});
  EXPECT_TRUE(show(&tracker, 0, one_person(0, 2)).empty());
  EXPECT_TRUE(show(&tracker, kFrameTime, one_person(0, 2)).empty());
  const auto movers = show(&tracker, 2 * kFrameTime, one_person(0, 2));
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(movers[0].id, 1);
  EXPECT_EQ(movers[0].class_name, "person");
  EXPECT_NEAR(movers[0].position_in_world.z(), 2, 1e-6);
}

TEST(MoverTracker, FewImagesASecondAreEnough) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  for (int i = 0; i < 6; ++i) movers = show(&tracker, 0.25 * i, one_person(0, 2));
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(movers[0].id, 1);
}

TEST(MoverTracker, VelocityIsThatOfTheMover) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  for (int i = 0; i < 30; ++i) movers = show(&tracker, i * kFrameTime, one_person(-0.5 + i * kFrameTime, 2.5));
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_NEAR(movers[0].velocity_in_world.x(), 1.0, 0.15);
  EXPECT_NEAR(movers[0].velocity_in_world.z(), 0.0, 0.1);
}

TEST(MoverTracker, ACameraThatMovesDoesNotMoveTheMovers) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  for (int i = 0; i < 30; ++i) {
    const double shift = 0.5 * i * kFrameTime;
    movers =
        show(&tracker, i * kFrameTime, one_person(0.3 - shift, 2.5), {Eigen::Quaterniond::Identity(), {shift, 0, 0}});
  }
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_NEAR(movers[0].position_in_world.x(), 0.3, 0.02);
  EXPECT_LT(movers[0].velocity_in_world.norm(), 0.15);
}

void expect_ids_kept_through_a_crossing(bool with_boxes) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  int left_id = 0, right_id = 0, hidden = 0;
  for (int i = 0; i <= 60; ++i) {
    // The near one walks right and hides the far one, who walks left, for a while.
    const double t = i * kFrameTime;
    MoverTestScene scene;
    add_person(-0.9 + 0.9 * t, 1.8, &scene, with_boxes);
    add_person(1.1 - 0.9 * t, 3.0, &scene, with_boxes);
    movers = show(&tracker, t, scene);
    hidden += i > 5 && movers.size() < 2;
    if (i == 10) {
      ASSERT_EQ(movers.size(), 2u);
      left_id = movers[0].position_in_world.x() < 0 ? movers[0].id : movers[1].id;
      right_id = 3 - left_id;
    }
  }
  EXPECT_GT(hidden, 3);
  ASSERT_EQ(movers.size(), 2u);
  for (const Mover& m : movers) EXPECT_EQ(m.id, m.position_in_world.z() < 2.4 ? left_id : right_id);
}

TEST(MoverTracker, WhatIsSeenFromAnExpectedPoseMovesWithTheOneThatIsFound) {
  const Rigid3 found(Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())), {1, 2, 3});
  const Rigid3 expected =
      found * Rigid3(Eigen::Quaterniond(Eigen::AngleAxisd(0.03, Eigen::Vector3d::UnitX())), {0.05, -0.04, 0.03});
  MoverTracker tracker(MoverTestScene().camera, {}), told(MoverTestScene().camera, {});
  for (int i = 0; i < 6; ++i) {
    const MoverTestScene scene = one_person(-0.1 + 0.02 * i, 2);
    const auto movers = tracker.update(tracker.look(i * kFrameTime, scene.depth, scene.mask, scene.boxes, expected),
                                       scene.depth, found);
    const auto same = show(&told, i * kFrameTime, scene, found);
    ASSERT_EQ(movers.size(), same.size());
    if (movers.empty()) continue;
    EXPECT_EQ(movers[0].id, same[0].id);
    EXPECT_LT((movers[0].position_in_world - same[0].position_in_world).norm(), 0.02);
    EXPECT_LT((movers[0].velocity_in_world - same[0].velocity_in_world).norm(), 0.05);
  }
}

TEST(MoverTracker, IdsAreKeptThroughACrossing) {
  expect_ids_kept_through_a_crossing(true);
}
TEST(MoverTracker, IdsAreKeptThroughACrossingWithoutBoxes) {
  expect_ids_kept_through_a_crossing(false);
}

TEST(MoverTracker, WhoIsHiddenForLongKeepsTheId) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  int hidden = 0;
  for (int i = 0; i <= 120; ++i) {
    // Somebody walks to the right behind a pillar 1 m wide that is as near as half of the way.
    MoverTestScene scene;
    const double x = -1.2 + 0.6 * i * kFrameTime;
    for (int y = 0; y < 240; ++y)
      for (int u = 100; u < 225; ++u) scene.depth(u, y) = 2;
    add_person(x, 3.5, &scene, false);
    movers = show(&tracker, i * kFrameTime, scene);
    hidden += movers.empty() && i > 5;
  }
  EXPECT_GT(hidden, 40);  // more than the 1.2 s after which one is forgotten who is hidden by nothing
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(movers[0].id, 1);
}

TEST(MoverTracker, WhoIsHiddenForGoodIsForgotten) {
  const auto id_after = [](double seconds_hidden) {
    MoverTracker tracker(MoverTestScene().camera, {});
    std::vector<Mover> movers;
    const int gone = 10, back = gone + static_cast<int>(seconds_hidden / kFrameTime);
    for (int i = 0; i < back + 5; ++i) {
      MoverTestScene scene;
      if (i < gone || i >= back)
        add_person(0, 3.5, &scene, false);
      else
        for (int y = 0; y < 240; ++y)
          for (int u = 0; u < 320; ++u) scene.depth(u, y) = 2;
      movers = show(&tracker, i * kFrameTime, scene);
    }
    return movers.size() == 1 ? movers[0].id : 0;
  };
  EXPECT_EQ(id_after(3), 1);
  EXPECT_EQ(id_after(8), 2) << "he may have gone anywhere";
}

TEST(MoverTracker, WhoStopsIsFollowedThoughNothingMovesUntilHeIsSeenThrough) {
  const auto stop_after = [](double way, bool leaves) {
    MoverTracker tracker(MoverTestScene().camera, {});
    std::vector<Mover> movers;
    for (int i = 0; i < 120; ++i) {
      MoverTestScene scene;
      if (!leaves || i < 110) add_person(-0.5 + way * std::min(1.0, i / 30.0), 2.5, &scene, false);
      if (i > 40) scene.mask.cells = {};  // the motion segmentation has forgotten him
      movers = show(&tracker, i * kFrameTime, scene);
    }
    return movers;
  };
  const std::vector<Mover> stands = stop_after(1.0, false);
  ASSERT_EQ(stands.size(), 1u);
  EXPECT_EQ(stands[0].id, 1);
  EXPECT_NEAR(stands[0].position_in_world.x(), 0.5, 0.02);
  EXPECT_LT(stands[0].velocity_in_world.norm(), 0.1);
  EXPECT_TRUE(stop_after(1.0, true).empty());
  EXPECT_TRUE(stop_after(0.1, false).empty());  // has never gone anywhere: a fault of the mask, maybe
}

// Two things that always stood there: the mask is wrong about one after the other.
TEST(MoverTracker, FaultsOfTheMaskThatFollowUponEachOtherAreNobodyWhoHasMoved) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  int told = 0;
  for (int i = 0; i < 60; ++i) {
    MoverTestScene scene;
    add_person(-0.35, 2.5, &scene, false);
    add_person(0.35, 2.5, &scene, false);
    for (int y = 0; y < 60; ++y)
      for (int x = 0; x < 80; ++x)
        if ((x < 40) != (i < 15) || i >= 30) scene.mask.cells(x, y) = 0;
    movers = show(&tracker, i * kFrameTime, scene);
    told += static_cast<int>(movers.size());
  }
  EXPECT_GT(told, 0) << "as long as the mask says so";
  EXPECT_TRUE(movers.empty());
}

TEST(MoverTracker, ABoxWithoutDepthGoesOnWithWhomItIsLeftOf) {
  MoverTracker tracker(MoverTestScene().camera, {});
  for (int i = 0; i < 5; ++i) show(&tracker, i * kFrameTime, one_person(0, 2));
  MoverTestScene foot;
  foot.boxes.push_back({"person", {150, 190, 20, 17}, 1});
  foot.mask.cells(0, 0) = 255;
  const auto movers = show(&tracker, 5 * kFrameTime, foot);
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(movers[0].id, 1);
  EXPECT_NEAR(movers[0].position_in_world.z(), 2, 1e-6);
  // Of each coordinate: their variances make up the position's.
  EXPECT_NEAR(3 * movers[0].position_sd * movers[0].position_sd, movers[0].covariance.diagonal().head<3>().sum(),
              1e-12);
  MoverTestScene elsewhere;
  elsewhere.boxes.push_back({"person", {250, 190, 20, 17}, 1});
  elsewhere.mask.cells(0, 0) = 255;
  EXPECT_TRUE(show(&tracker, 6 * kFrameTime, elsewhere).empty());
}

int id_after_gap(double seconds) {
  MoverTracker tracker(MoverTestScene().camera, {});
  double t = 0;
  for (; t < 0.5; t += kFrameTime) show(&tracker, t, one_person(0, 2));
  t += seconds;
  std::vector<Mover> movers;
  for (int i = 0; i < 3; ++i) movers = show(&tracker, t + i * kFrameTime, one_person(0, 2));
  return movers.empty() ? 0 : movers[0].id;
}

TEST(MoverTracker, AMoverIsKnownAgainAfterOneSecondAndForgottenAfterTwo) {
  EXPECT_EQ(id_after_gap(1.0), 1);
  EXPECT_EQ(id_after_gap(2.0), 2);
}

TEST(MoverTracker, UnseenMoversAreNotReported) {
  MoverTracker tracker(MoverTestScene().camera, {});
  for (int i = 0; i < 5; ++i) show(&tracker, i * kFrameTime, one_person(0, 2));
  EXPECT_TRUE(show(&tracker, 5 * kFrameTime, MoverTestScene()).empty());
}

TEST(MoverTracker, AThingInTwoBoxesIsOneMover) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  for (int i = 0; i < 6; ++i) {
    MoverTestScene scene = one_person(0, 2);
    scene.boxes.push_back(scene.boxes[0]);
    movers = show(&tracker, i * kFrameTime, scene);
  }
  EXPECT_EQ(movers.size(), 1u);
}

TEST(MoverTracker, RegionsWithoutABoxAreObjects) {
  MoverTracker tracker(MoverTestScene().camera, {});
  std::vector<Mover> movers;
  for (int i = 0; i < 3; ++i) {
    MoverTestScene scene;
    add_person(0, 2, &scene, false);
    movers = show(&tracker, i * kFrameTime, scene);
  }
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(movers[0].class_name, "object");
}

TEST(MoverTracker, RebasingMovesWhatIsRemembered) {
  MoverTracker tracker(MoverTestScene().camera, {});
  for (int i = 0; i < 5; ++i) show(&tracker, i * kFrameTime, one_person(0, 2));
  const Rigid3 new_from_old(Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitY())), {5, 0, -3});
  tracker.rebase(new_from_old);
  const auto movers = show(&tracker, 5 * kFrameTime, one_person(0, 2), new_from_old);
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(movers[0].id, 1);
}

}  // namespace
}  // namespace dkb
