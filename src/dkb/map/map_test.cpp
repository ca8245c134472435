// SPDX-License-Identifier: Apache-2.0
#include "dkb/map/map.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "dkb/map/map_test_tools.h"

namespace dkb {
namespace {

using test::born;
using test::broken_invariant;
using test::fingerprint;
using test::keyframe_at;
using test::ThreeKeyframes;

TEST(PointIds, NameBirthKeyframeAndFeature) {
  const PointId id = make_point_id(300, 8191);
  EXPECT_EQ(birth_keyframe(id), 300);
  EXPECT_EQ(birth_feature(id), 8191);
  EXPECT_LT(make_point_id(299, 8191), make_point_id(300, 0));
}

TEST(Map, UnknownIdsGiveNothing) {
  const ThreeKeyframes world;
  EXPECT_EQ(world.map.keyframe(-1), nullptr);
  EXPECT_EQ(world.map.keyframe(3), nullptr);
  EXPECT_EQ(world.map.point(kNoPoint), nullptr);
  EXPECT_EQ(world.map.point(make_point_id(0, 5)), nullptr);
  EXPECT_EQ(world.map.point(make_point_id(90, 5)), nullptr);
  EXPECT_EQ(world.map.resolve(make_point_id(90, 5)), kNoPoint);
  EXPECT_THROW(world.map.cam_from_world(3), std::logic_error);
}

TEST(Map, ObservationsAreKnownToBothSides) {
  const ThreeKeyframes world;
  EXPECT_EQ(world.map.point(world.a)->observations, (std::vector<Observation>{{0, 0}, {1, 5}, {2, 0}}));
  EXPECT_EQ(world.map.keyframe(1)->points[5], world.a);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, AddingAKeyframeAddsItsObservationsThroughFusions) {
  ThreeKeyframes world;
  world.map.fuse(world.b, world.c);
  world.map.remove_point(world.d);
  Keyframe k = keyframe_at(3, 3);
  k.points = {kNoPoint, world.b, kNoPoint, world.d, world.a, kNoPoint};
  world.map.add_keyframe(k);
  EXPECT_EQ(world.map.keyframe(3)->points[1], world.c);
  EXPECT_EQ(world.map.keyframe(3)->points[3], kNoPoint);
  EXPECT_EQ(world.map.keyframe(3)->points[4], world.a);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, KeyframeIdsMustFollowOneAnother) {
  Map map;
  EXPECT_THROW(map.add_keyframe(keyframe_at(1, 0)), std::logic_error);
}

TEST(Map, APointIsBornOnce) {
  ThreeKeyframes world;
  MapPoint again;
  again.id = world.a;
  EXPECT_THROW(world.map.add_point(again), std::logic_error);
  world.map.remove_point(world.a);
  EXPECT_THROW(world.map.add_point(again), std::logic_error);
  EXPECT_THROW(world.map.add_point(MapPoint()), std::logic_error);
}

TEST(Map, AFeatureShowsOnePointTheNewer) {
  ThreeKeyframes world;
  world.map.observe(world.d, 1, 5);  // showed a
  EXPECT_EQ(world.map.keyframe(1)->points[5], world.d);
  EXPECT_EQ(world.map.point(world.a)->observations, (std::vector<Observation>{{0, 0}, {2, 0}}));
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, AKeyframeShowsAPointOnceTheFirst) {
  ThreeKeyframes world;
  world.map.observe(world.a, 1, 0);
  EXPECT_EQ(world.map.keyframe(1)->points[0], kNoPoint);
  EXPECT_EQ(world.map.keyframe(1)->points[5], world.a);
}

TEST(Map, AFeatureThatIsNotThereCannotBeObserved) {
  ThreeKeyframes world;
  EXPECT_THROW(world.map.observe(world.d, 1, 6), std::out_of_range);
  EXPECT_THROW(world.map.observe(world.d, 1, -1), std::out_of_range);
}

TEST(Map, APointWithNoObservationLeftIsRemoved) {
  ThreeKeyframes world;
  EXPECT_EQ(world.map.point_count(), 4u);
  world.map.forget(world.d, 0);
  EXPECT_EQ(world.map.point(world.d), nullptr);
  EXPECT_EQ(world.map.point_count(), 3u);
  world.map.forget(world.d, 0);
  EXPECT_EQ(world.map.point_count(), 3u);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, PointsOfAKeyframeOutliveEachOtherInAnyOrder) {
  Map map;
  Keyframe k;
  k.id = 0;
  auto features = std::make_shared<RgbdFeatures>();
  features->keypoints.resize(5), features->descriptors.resize(5);
  k.features = features;
  map.add_keyframe(std::move(k));
  for (const int f : {3, 0, 4, 1}) {
    MapPoint p;
    p.id = make_point_id(0, f);
    p.position.x() = f;
    map.add_point(std::move(p));
    map.observe(make_point_id(0, f), 0, f);
  }
  map.remove_point(make_point_id(0, 0));
  map.fuse(make_point_id(0, 3), make_point_id(0, 1));
  EXPECT_EQ(map.live_points(), (std::vector<PointId>{make_point_id(0, 1), make_point_id(0, 4)}));
  for (const int f : {1, 4}) EXPECT_EQ(map.point(make_point_id(0, f))->position.x(), f);
  const std::vector<RemovedPoint> removed{{make_point_id(0, 0), kNoPoint}, {make_point_id(0, 3), make_point_id(0, 1)}};
  EXPECT_EQ(map.removed_points(), removed);
  EXPECT_EQ(map.resolve(make_point_id(0, 3)), make_point_id(0, 1));
}

TEST(Map, RemovedPointsLeaveNoTraceInKeyframes) {
  ThreeKeyframes world;
  world.map.remove_point(world.a);
  EXPECT_EQ(world.map.keyframe(0)->points[0], kNoPoint);
  EXPECT_EQ(world.map.keyframe(1)->points[5], kNoPoint);
  EXPECT_EQ(world.map.keyframe(2)->points[0], kNoPoint);
  EXPECT_EQ(world.map.resolve(world.a), kNoPoint);
  EXPECT_EQ(world.map.removed_points(), (std::vector<RemovedPoint>{{world.a, kNoPoint}}));
}

TEST(Map, FusionMovesObservationsAndCounts) {
  ThreeKeyframes world;
  world.map.edit_point(world.a).found = 10;
  world.map.edit_point(world.a).visible = 12;
  world.map.edit_point(world.d).found = 3;
  world.map.edit_point(world.d).visible = 4;
  world.map.fuse(world.a, world.d);
  // Keyframe 0 showed both: its feature of d stays, that of a is free. Those of keyframes 1 and 2 move.
  EXPECT_EQ(world.map.point(world.d)->observations, (std::vector<Observation>{{0, 3}, {1, 5}, {2, 0}}));
  EXPECT_EQ(world.map.keyframe(0)->points[0], kNoPoint);
  EXPECT_EQ(world.map.keyframe(1)->points[5], world.d);
  EXPECT_EQ(world.map.point(world.d)->found, 13);
  EXPECT_EQ(world.map.point(world.d)->visible, 16);
  EXPECT_EQ(world.map.point_count(), 3u);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, ChainsOfFusionsResolveToTheSurvivor) {
  ThreeKeyframes world;
  world.map.fuse(world.a, world.b);
  world.map.fuse(world.b, world.c);
  EXPECT_EQ(world.map.resolve(world.a), world.c);
  world.map.fuse(world.c, world.a);  // a is gone: nothing happens
  EXPECT_EQ(world.map.resolve(world.a), world.c);
  world.map.remove_point(world.c);
  EXPECT_EQ(world.map.resolve(world.a), kNoPoint);
}

TEST(Map, ThePointsOfKeyframesAreGivenOnceEachInOrder) {
  ThreeKeyframes world;
  EXPECT_EQ(world.map.points_of({1}), (std::vector<PointId>{world.a, world.b, world.c})) << "seen at 5, 4 and 3";
  const PointId e = born(world.map, 2, 4);
  EXPECT_EQ(world.map.points_of({2, 1}), (std::vector<PointId>{world.a, world.b, world.c, e}));
  EXPECT_EQ(world.map.points_of({2, 2}), (std::vector<PointId>{world.a, e}));
  world.map.remove_point(world.a);
  EXPECT_EQ(world.map.points_of({2}), std::vector<PointId>{e});
  world.map.cull_keyframe(1);
  EXPECT_TRUE(world.map.points_of({1}).empty());
  EXPECT_TRUE(world.map.points_of({}).empty());
}

TEST(Map, TheKeyframesThatSeePointsAreGivenByTheirNumberTheOlderFirstInATie) {
  const ThreeKeyframes world;
  const auto observers = [&](const std::vector<PointId>& points) {
    std::vector<std::pair<KeyframeId, int>> found;
    for (const Covisible& c : world.map.observers_of(points)) found.emplace_back(c.keyframe, c.shared_points);
    return found;
  };
  using Found = std::vector<std::pair<KeyframeId, int>>;
  EXPECT_EQ(observers({world.d, world.a, world.b}), (Found{{0, 3}, {1, 2}, {2, 1}}));
  EXPECT_EQ(observers({world.c, kNoPoint, world.b}), (Found{{0, 2}, {1, 2}}));
  EXPECT_EQ(observers({kNoPoint, make_point_id(7, 3), make_point_id(0, 9)}), Found{});
  EXPECT_EQ(observers({}), Found{});
}

TEST(Map, TheOneThatSeesMostPointsComesFirstThoughItIsNewer) {
  ThreeKeyframes world;
  const PointId e = born(world.map, 2, 4), f = born(world.map, 2, 5);
  const auto first = [&](const std::vector<PointId>& points) { return world.map.observers_of(points)[0].keyframe; };
  EXPECT_EQ(first({world.d, e, f}), 2);
  EXPECT_EQ(first({world.d, e}), 0);
  EXPECT_EQ(first({e, kNoPoint, f, world.d}), 2);
}

TEST(Map, CovisibilityCountsSharedPointsAndIsMirrored) {
  ThreeKeyframes world;
  world.map.update_covisibility(1, 1);
  // Keyframe 1 shares a, b, c with 0, and a with 2.
  ASSERT_EQ(world.map.keyframe(1)->covisible.size(), 2u);
  EXPECT_EQ(world.map.keyframe(1)->covisible[0].keyframe, 0);
  EXPECT_EQ(world.map.keyframe(1)->covisible[0].shared_points, 3);
  EXPECT_EQ(world.map.keyframe(1)->covisible[1].keyframe, 2);
  EXPECT_EQ(world.map.keyframe(1)->covisible[1].shared_points, 1);
  ASSERT_EQ(world.map.keyframe(2)->covisible.size(), 1u);
  EXPECT_EQ(world.map.keyframe(2)->covisible[0].keyframe, 1);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, TooWeakCovisibilityLeavesTheBestEdgeAndThoseOfKeyframesThatHaveNoOther) {
  ThreeKeyframes world;
  world.map.update_covisibility(1, 1);
  world.map.update_covisibility(1, 4);
  ASSERT_EQ(world.map.keyframe(1)->covisible.size(), 2u);
  EXPECT_EQ(world.map.keyframe(1)->covisible[0].keyframe, 0);
  ASSERT_EQ(world.map.keyframe(2)->covisible.size(), 1u) << "it has nobody else";
  EXPECT_EQ(broken_invariant(world.map), "");
  world.map.update_covisibility(2, 1);  // it shares a with 0, too
  world.map.update_covisibility(1, 4);
  ASSERT_EQ(world.map.keyframe(1)->covisible.size(), 1u);
  EXPECT_EQ(world.map.keyframe(1)->covisible[0].keyframe, 0);
  ASSERT_EQ(world.map.keyframe(2)->covisible.size(), 1u);
  EXPECT_EQ(world.map.keyframe(2)->covisible[0].keyframe, 0);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, AKeyframeWithoutNeighboursTakesWhateverEdgeThereIs) {
  ThreeKeyframes world;
  world.map.update_covisibility(1, 4);  // 0 is its best; 2 has nobody yet, and shares one point with it
  EXPECT_EQ(points_shared_with(1, world.map.keyframe(2)->covisible), 1);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, CulledKeyframesRideOnTheirParents) {
  ThreeKeyframes world;
  const Rigid3 before = world.map.cam_from_world(1);
  world.map.cull_keyframe(1);
  EXPECT_EQ(world.map.live_keyframe(1), nullptr);
  ASSERT_NE(world.map.keyframe(1), nullptr);
  EXPECT_TRUE(before.translation.isApprox(world.map.cam_from_world(1).translation, 1e-15));
  EXPECT_EQ(world.map.keyframe(2)->parent, 0);
  EXPECT_EQ(world.map.point(world.b)->observations, (std::vector<Observation>{{0, 1}}));
  // Parent at x = 10 instead of 0: what stood 1 m from it still does.
  Rigid3 moved = world.map.cam_from_world(0);
  moved.translation.x() = 10;
  world.map.set_pose(0, moved);
  EXPECT_NEAR(world.map.cam_from_world(1).translation.x(), 11, 1e-12);
  EXPECT_EQ(broken_invariant(world.map), "");
}

TEST(Map, ChainsOfCulledKeyframesKeepTheirRelativePoses) {
  Map map;
  for (KeyframeId id = 0; id < 5; ++id) map.add_keyframe(keyframe_at(id, id * id));
  map.cull_keyframe(3);  // hangs on 2
  map.cull_keyframe(2);  // hangs on 1, and 3 with it
  const Rigid3 to = Rigid3(rotation_from_vector({0.3, -0.2, 0.1}), {4, 5, 6});
  const Rigid3 three_from_one = map.cam_from_world(3) * map.cam_from_world(1).inverse();
  map.set_pose(1, to);
  const Rigid3 after = map.cam_from_world(3) * map.cam_from_world(1).inverse();
  EXPECT_TRUE(after.translation.isApprox(three_from_one.translation, 1e-12));
  EXPECT_LT(after.rotation.angularDistance(three_from_one.rotation), 1e-12);
  EXPECT_EQ(map.keyframe(4)->parent, 1);
  EXPECT_EQ(map.live_keyframes(), (std::vector<KeyframeId>{0, 1, 4}));
  EXPECT_EQ(broken_invariant(map), "");
}

// The motion of a keyframe 1 m to the side since the one before.
Keyframe moved(KeyframeId id, KeyframeId previous) {
  Keyframe k = keyframe_at(id, id);
  const Rigid3 previous_from_current(Eigen::Quaterniond::Identity(), {-1, 0, 0});
  k.motion = std::make_shared<const KeyframeMotion>(
      KeyframeMotion{previous, {previous_from_current, false, 0.01 * Matrix6d::Identity()}});
  return k;
}

TEST(Map, TheMotionOfACulledKeyframeJoinsThatOfTheNext) {
  Map map;
  map.add_keyframe(keyframe_at(0, 0));
  for (KeyframeId id = 1; id < 5; ++id) map.add_keyframe(moved(id, id - 1));
  EXPECT_EQ(map.keyframe(1)->followers, std::vector<KeyframeId>{2});
  EXPECT_TRUE(map.keyframe(4)->followers.empty());
  map.cull_keyframe(2);
  map.cull_keyframe(1);
  ASSERT_TRUE(map.keyframe(3)->motion);
  EXPECT_EQ(map.keyframe(3)->motion->previous, 0);
  EXPECT_TRUE(map.keyframe(3)->motion->since.previous_from_current.translation.isApprox(Eigen::Vector3d(-3, 0, 0)));
  // What turned in the first of three steps is 2 m to the side at the end, what turned in the second 1 m.
  EXPECT_NEAR(map.keyframe(3)->motion->since.covariance(5, 5), 0.03, 1e-12);
  EXPECT_NEAR(map.keyframe(3)->motion->since.covariance(1, 1), 0.03 + 0.01 * (4 + 1), 1e-12);
  EXPECT_EQ(map.keyframe(0)->followers, std::vector<KeyframeId>{3});
  EXPECT_EQ(map.keyframe(4)->motion->previous, 3);
  EXPECT_FALSE(map.keyframe(1)->motion);
}

TEST(Map, AMotionPastOtherKeyframesOutlivesTheOneItBeganAt) {
  Map map;
  map.add_keyframe(keyframe_at(0, 0));
  map.add_keyframe(moved(1, 0));
  map.add_keyframe(keyframe_at(2, 2));
  map.add_keyframe(moved(3, 1));
  map.cull_keyframe(1);
  ASSERT_TRUE(map.keyframe(3)->motion);
  EXPECT_EQ(map.keyframe(3)->motion->previous, 0);
  EXPECT_TRUE(map.keyframe(3)->motion->since.previous_from_current.translation.isApprox(Eigen::Vector3d(-2, 0, 0)));
}

TEST(Map, AMotionAfterAGapOutlivesTheKeyframeItBeganAt) {
  Map map;
  map.add_keyframe(keyframe_at(0, 0));
  map.add_keyframe(moved(1, 0));
  map.add_keyframe(keyframe_at(2, 2.5));  // nothing tells how the camera came here
  map.add_keyframe(moved(3, 2));
  map.cull_keyframe(1);
  EXPECT_FALSE(map.keyframe(2)->motion) << "a gap stays a gap";
  map.cull_keyframe(2);
  ASSERT_TRUE(map.keyframe(3)->motion);
  EXPECT_EQ(map.keyframe(3)->motion->previous, 0) << "on which the culled one rides";
  EXPECT_TRUE(map.keyframe(3)->motion->since.previous_from_current.translation.isApprox(Eigen::Vector3d(-3.5, 0, 0)));
  const Matrix6d leg = edge_covariance(map.keyframe(2)->cam_from_parent, 0);
  EXPECT_NEAR(map.keyframe(3)->motion->since.covariance(3, 3), 0.01 + leg(3, 3), 1e-12) << "and how it rides on it";
}

// Two keyframes say how the camera moved since the same one.
TEST(Map, WhatIsKnownOfTheWayToACulledKeyframeCountsOnce) {
  Map map;
  map.add_keyframe(keyframe_at(0, 0));
  map.add_keyframe(keyframe_at(1, 1));
  map.add_keyframe(moved(2, 0));
  map.add_keyframe(moved(3, 2));
  map.add_keyframe(moved(4, 2));
  EXPECT_EQ(map.keyframe(2)->followers, (std::vector<KeyframeId>{3, 4}));
  map.cull_keyframe(2);
  ASSERT_TRUE(map.keyframe(3)->motion && map.keyframe(4)->motion);
  EXPECT_EQ(map.keyframe(3)->motion->previous, 0);
  EXPECT_EQ(map.keyframe(4)->motion->previous, 1) << "its parent";
  EXPECT_EQ(map.keyframe(0)->followers, std::vector<KeyframeId>{3});
  EXPECT_EQ(map.keyframe(1)->followers, std::vector<KeyframeId>{4});
  EXPECT_GT(map.keyframe(4)->motion->since.covariance(3, 3), 0.01) << "nobody knows that exactly";
}

TEST(Map, NoMotionLeadsFromAYoungerKeyframe) {
  Map map;
  map.add_keyframe(keyframe_at(0, 0));
  map.add_keyframe(keyframe_at(1, 1));
  map.add_keyframe(moved(2, 1));
  map.set_parent(2, 0);  // as where a tree was turned round to hang on another
  map.set_parent(1, 2);
  map.cull_keyframe(1);
  EXPECT_FALSE(map.keyframe(2)->motion);
}

TEST(Map, TheRootIsNotCulled) {
  ThreeKeyframes world;
  world.map.cull_keyframe(0);
  EXPECT_NE(world.map.live_keyframe(0), nullptr);
}

TEST(Map, ACulledParentIsReplacedByItsOwn) {
  ThreeKeyframes world;
  world.map.cull_keyframe(1);
  world.map.add_keyframe(keyframe_at(3, 3));
  world.map.set_parent(3, 1);
  EXPECT_EQ(world.map.keyframe(3)->parent, 0);
}

TEST(Map, AKeyframeCannotHangOnItsDescendant) {
  ThreeKeyframes world;
  EXPECT_THROW(world.map.set_parent(0, 2), std::logic_error);
  EXPECT_THROW(world.map.set_parent(1, 1), std::logic_error);
}

TEST(Map, InvariantsSurviveRandomEdits) {
  for (uint64_t seed = 1; seed <= 30; ++seed) {
    Random random(seed);
    Map map;
    std::vector<std::pair<MapView, std::string>> views;
    for (int k = 0; k < 12; ++k) {
      test::add_random_keyframe(map, random, 15, 8, 5);
      for (int e = 0; e < 25; ++e) {
        test::random_edit(map, random);
        ASSERT_EQ(broken_invariant(map), "") << "seed " << seed << ", keyframe " << k << ", edit " << e;
      }
      const MapView view = map.snapshot();
      views.emplace_back(view, fingerprint(*view));
    }
    for (size_t v = 0; v < views.size(); ++v)
      ASSERT_EQ(fingerprint(*views[v].first), views[v].second) << "seed " << seed << ", view " << v;
  }
}

TEST(Map, CulledPosesKeepTheirPlaceBesideTheirParentThroughRandomEdits) {
  Random random(77);
  Map map = test::random_map(77, 10, 10, 0);
  for (KeyframeId id = 1; id < 10; id += 2) map.cull_keyframe(id);
  std::vector<Rigid3> relative;
  for (KeyframeId id = 0; id < 10; ++id) {
    const KeyframeId parent = map.keyframe(id)->parent;
    relative.push_back(parent == kNoKeyframe ? Rigid3()
                                             : map.cam_from_world(id) * map.cam_from_world(parent).inverse());
  }
  for (KeyframeId id : map.live_keyframes())
    map.set_pose(id, Rigid3(rotation_from_vector({random.normal(), 0, 0}), {random.normal(), 0, 0}));
  for (KeyframeId id = 1; id < 10; id += 2) {
    const Rigid3 now = map.cam_from_world(id) * map.cam_from_world(map.keyframe(id)->parent).inverse();
    EXPECT_TRUE(now.translation.isApprox(relative[static_cast<size_t>(id)].translation, 1e-9));
    EXPECT_LT(now.rotation.angularDistance(relative[static_cast<size_t>(id)].rotation), 1e-7);
  }
}

TEST(Map, FindsAKeyframeByItsLooksUntilItIsCulled) {
  Map map = test::random_map(7, 12, 60, 0);
  const KeyframeId sought = map.live_keyframes()[5];
  const std::vector<Descriptor> looks = map.keyframe(sought)->features->descriptors;
  const MapView before = map.snapshot();
  ASSERT_FALSE(map.similar_keyframes(looks, 3).empty());
  EXPECT_EQ(map.similar_keyframes(looks, 3).front().id, sought);
  map.cull_keyframe(sought);
  for (const PlaceMatch& m : map.similar_keyframes(looks, 12)) EXPECT_NE(m.id, sought);
  EXPECT_EQ(before->similar_keyframes(looks, 3).front().id, sought) << "the snapshot is of before";
}

TEST(Map, TheRootIsTheEndOfTheWayUp) {
  const Map map = test::random_map(8, 10, 30, 5);
  for (KeyframeId k = 0; k < map.keyframe_count(); ++k) {
    const Keyframe& root = *map.keyframe(map.root(k));
    EXPECT_EQ(root.parent, kNoKeyframe);
    const KeyframeId parent = map.keyframe(k)->parent;
    EXPECT_EQ(root.id, parent == kNoKeyframe ? k : map.root(parent));
  }
  EXPECT_THROW(map.root(10), std::logic_error);
}

TEST(Map, TheNewestBesideAKeyframeAreOfItsOwnMap) {
  ThreeKeyframes m;
  Keyframe apart = keyframe_at(3, 0);
  apart.parent = kNoKeyframe;
  m.map.add_keyframe(apart);
  EXPECT_EQ(m.map.newest_beside(0, 2), (std::vector<KeyframeId>{1, 2}));
  EXPECT_EQ(m.map.newest_beside(3, 2), std::vector<KeyframeId>{3});
  EXPECT_EQ(m.map.map_of_each(), (std::vector<int>{0, 0, 0, 1}));
  EXPECT_TRUE(m.map.newest_beside(kNoKeyframe, 2).empty());
  EXPECT_TRUE(m.map.newest_beside(4, 2).empty());
}

TEST(Map, ChildrenAreWhoeverLivesAndHangsOnAKeyframe) {
  Map map = test::random_map(8, 10, 30, 5);
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    std::vector<KeyframeId> expected;
    for (KeyframeId k : map.live_keyframes())
      if (map.keyframe(k)->parent == id) expected.push_back(k);
    EXPECT_EQ(map.keyframe(id)->children, expected) << id;
  }
}

TEST(Map, TheBestCovisibleKeyframesAreAsManyAsAreWantedOrThere) {
  ThreeKeyframes world;
  world.map.update_covisibility(1, 1);
  EXPECT_EQ(world.map.best_covisible(1, 0), std::vector<KeyframeId>{});
  EXPECT_EQ(world.map.best_covisible(1, 1), std::vector<KeyframeId>{0});
  EXPECT_EQ(world.map.best_covisible(1, 5), (std::vector<KeyframeId>{0, 2}));
}

TEST(Map, KeyframesWithoutAParentAreTheRoots) {
  ThreeKeyframes m;
  EXPECT_EQ(m.map.roots(), std::vector<KeyframeId>{0});
  Keyframe apart = keyframe_at(3, 0);
  apart.parent = kNoKeyframe;
  m.map.add_keyframe(apart);
  m.map.add_keyframe(keyframe_at(4, 1));
  EXPECT_EQ(m.map.roots(), (std::vector<KeyframeId>{0, 3}));
  EXPECT_EQ(m.map.root(4), 3);
  m.map.cull_keyframe(3);
  EXPECT_NE(m.map.live_keyframe(3), nullptr) << "a root stays";
  EXPECT_TRUE(Map().roots().empty());
}

TEST(Map, ASessionThatBeginsFindsItsKeyframesBeforeFrameZero) {
  Map map;
  for (KeyframeId id = 0; id < 3; ++id) {
    Keyframe k = keyframe_at(id, id);
    k.frame = 10 * id + 4;
    map.add_keyframe(k);
  }
  map.date_back();
  EXPECT_EQ(map.keyframe(0)->frame, -21);
  EXPECT_EQ(map.keyframe(1)->frame, -11);
  EXPECT_EQ(map.keyframe(2)->frame, -1);
}

}  // namespace
}  // namespace dkb
