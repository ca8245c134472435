// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <thread>

#include "dkb/map/map.h"
#include "dkb/map/map_test_tools.h"

namespace dkb {
namespace {

using test::born;
using test::fingerprint;
using test::keyframe_at;
using test::ThreeKeyframes;

TEST(MapSnapshots, DoNotSeeLaterWrites) {
  ThreeKeyframes world;
  const MapView view = world.map.snapshot();
  const std::string before = fingerprint(*view);
  world.map.fuse(world.a, world.b);
  world.map.set_pose(0, Rigid3(Eigen::Quaterniond::Identity(), {9, 9, 9}));
  world.map.edit_point(world.c).position.x() = 5;
  world.map.cull_keyframe(1);
  world.map.add_keyframe(keyframe_at(3, 3));
  born(world.map, 3, 0);
  EXPECT_EQ(fingerprint(*view), before);
  EXPECT_NE(fingerprint(world.map), before);
}

TEST(MapSnapshots, ShareWhatDidNotChange) {
  ThreeKeyframes world;
  const MapView view = world.map.snapshot();
  world.map.set_pose(0, Rigid3());
  EXPECT_NE(view->keyframe(0), world.map.keyframe(0));
  EXPECT_EQ(view->keyframe(1), world.map.keyframe(1));
  EXPECT_EQ(view->keyframe(0)->features, world.map.keyframe(0)->features);
  EXPECT_EQ(view->point(world.a), world.map.point(world.a));
}

TEST(MapSnapshots, BetweenThemAPartIsCopiedOnce) {
  ThreeKeyframes world;
  const MapView view = world.map.snapshot();
  world.map.set_pose(0, Rigid3());
  const Keyframe* own = world.map.keyframe(0);
  world.map.set_pose(0, Rigid3(Eigen::Quaterniond::Identity(), {1, 0, 0}));
  EXPECT_EQ(world.map.keyframe(0), own);
}

TEST(MapSnapshots, CopiesOfThemAreIndependent) {
  ThreeKeyframes world;
  const MapView view = world.map.snapshot();
  const std::string before = fingerprint(*view);
  Map copy = *view;
  copy.set_pose(0, Rigid3(Eigen::Quaterniond::Identity(), {7, 0, 0}));
  copy.remove_point(world.a);
  EXPECT_EQ(fingerprint(*view), before);
  EXPECT_EQ(fingerprint(world.map), before);
  Map assigned;
  assigned = copy;
  assigned.remove_point(world.b);
  EXPECT_NE(copy.point(world.b), nullptr);
  copy.remove_point(world.c);
  EXPECT_NE(assigned.point(world.c), nullptr);
}

TEST(Map, CopiesAndTheirSourceAreIndependent) {
  ThreeKeyframes world;
  const Map copy = world.map;
  const std::string before = fingerprint(copy);
  world.map.edit_point(world.a).position.x() = 3;
  world.map.set_pose(2, Rigid3());
  EXPECT_EQ(fingerprint(copy), before);
}

TEST(Map, AMovedMapStaysApartFromItsSnapshots) {
  ThreeKeyframes world;
  const MapView view = world.map.snapshot();
  const std::string before = fingerprint(*view);
  Map moved = std::move(world.map);
  moved.set_pose(0, Rigid3(Eigen::Quaterniond::Identity(), {7, 0, 0}));
  moved.remove_point(world.a);
  EXPECT_EQ(fingerprint(*view), before);
}

TEST(MapSnapshots, AreReadWhileTheOwnerWrites) {  // for the thread sanitizer
  Map map = test::random_map(5, 8, 20, 0);
  const MapView view = map.snapshot();
  const std::string before = fingerprint(*view);
  std::string seen, copied;
  std::thread reader([&] {
    seen = fingerprint(*view);
    Map own = *view;
    Random random(9);
    for (int i = 0; i < 50; ++i) test::random_edit(own, random);
    copied = fingerprint(*view);
  });
  Random random(8);
  for (int i = 0; i < 200; ++i) {
    test::random_edit(map, random);
    if (i % 50 == 0) map.snapshot();
  }
  reader.join();
  EXPECT_EQ(seen, before);
  EXPECT_EQ(copied, before);
}

}  // namespace
}  // namespace dkb
