// SPDX-License-Identifier: Apache-2.0
// Poses: followed, lost and found again.
#include "dkb/tracking/tracker.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/tracking/tracker_test_fixture.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

TEST_F(TrackerTest, AMapStartsOnceEnoughFeaturesHaveDepth) {
  const TrackedFrame blind = track(Rigid3{}, {.depth_share = 0});
  EXPECT_EQ(blind.state, TrackingState::initialising);
  EXPECT_FALSE(blind.starts_map);
  const TrackedFrame first = track(Rigid3{});
  EXPECT_EQ(first.state, TrackingState::tracking);
  EXPECT_TRUE(first.starts_map);
}

TEST_F(TrackerTest, FollowsASteadyMotionThroughNoiseAndOutliers) {
  publish(start(on_path(0), kNoisy));
  for (int f = 1; f <= 30; ++f) {
    const TrackedFrame o = track(on_path(f), kNoisy);
    ASSERT_EQ(o.state, TrackingState::tracking) << "frame " << f;
    EXPECT_GT(o.inliers, 50);
    EXPECT_LT(distance_between(o.cam_from_world, on_path(f)), 0.015) << "frame " << f;
    EXPECT_LT(rotation_between(o.cam_from_world, on_path(f)), 0.3) << "frame " << f;
    int inliers = 0;
    for (size_t i = 0; i < o.points.size(); ++i) {
      if (o.points[i] == kNoPoint) continue;
      ++inliers;
      EXPECT_FALSE(o.outlier[i]);
      ASSERT_EQ(scene_point(o.points[i]), view.shows[i]) << "frame " << f << " feature " << i;
    }
    EXPECT_EQ(inliers, o.inliers);
  }
}

TEST_F(TrackerTest, ExactViewsGiveExactPoses) {
  publish(start());
  for (int f = 1; f <= 5; ++f) {
    const TrackedFrame o = track(on_path(f));
    EXPECT_LT(distance_between(o.cam_from_world, on_path(f)), 1e-5);
    EXPECT_LT(rotation_between(o.cam_from_world, on_path(f)), 1e-3);
  }
}

TEST_F(TrackerTest, TheFirstKeyframeMayStandAnywhere) {
  const Rigid3 mounted = TestScene::camera_at({0.3, -0.2, 0.4}, {0.1, 0.2, -0.1});
  start(mounted);
  const Rigid3 next = TestScene::camera_at({0.31, -0.2, 0.4}, {0.1, 0.2, -0.1});
  const TrackedFrame o = track(next);
  ASSERT_EQ(o.state, TrackingState::tracking);
  EXPECT_LT(distance_between(o.cam_from_world, next), 1e-5);
  const Rigid3 moved = tracker.take_view(std::make_shared<const Map>());
  EXPECT_LT(moved.translation.norm(), 1e-9) << "nothing moved the world";
}

// Two frames, a turn of 3 degrees between them and no notion of it: the narrow search would find wrong matches only.
TEST_F(TrackerTest, FollowsACameraThatTurnsFastFromTheVeryFirstFrame) {
  start({}, kNoisy);
  for (int f = 1; f <= 5; ++f) {
    const Rigid3 truth = TestScene::camera_at({0, 0, 0}, {0, 0.06 * f, 0});
    const TrackedFrame o = track(truth, kNoisy);
    ASSERT_EQ(o.state, TrackingState::tracking) << f;
    EXPECT_LT(distance_between(o.cam_from_world, truth), 0.02) << f;
    EXPECT_LT(rotation_between(o.cam_from_world, truth), 0.4) << f;
  }
}

TEST_F(TrackerTest, IsLostInTheDarkAndRecoversWhenTheViewReturns) {
  publish(start(on_path(0), kNoisy));
  for (int f = 1; f <= 5; ++f) track(on_path(f), kNoisy);
  black = true;
  for (int f = 0; f < 5; ++f) {
    const TrackedFrame o = track(on_path(5));
    EXPECT_EQ(o.state, TrackingState::lost);
    EXPECT_TRUE(tracker.velocity().isZero());
  }
  black = false;
  const Rigid3 elsewhere = on_path(12);
  EXPECT_EQ(track(on_path(11), kNoisy).state, TrackingState::lost) << "it has to be confirmed";
  TrackedFrame o = track(elsewhere, kNoisy);
  EXPECT_EQ(o.state, TrackingState::relocalised);
  EXPECT_LT(distance_between(o.cam_from_world, elsewhere), 0.015);
  o = track(on_path(13), kNoisy);
  EXPECT_EQ(o.state, TrackingState::tracking);
  EXPECT_LT(distance_between(o.cam_from_world, on_path(13)), 0.015);
}

TEST_F(TrackerTest, AnotherPlaceIsNotMistakenForTheMap) {
  publish(start());
  track(on_path(0));
  const TestScene other(700, 99);
  for (int f = 0; f < 3; ++f) {
    ++index;
    const View there = other.look(on_path(f));
    EXPECT_EQ(track(FakeFeatures(there.features)).state, TrackingState::lost);
  }
}

TEST_F(TrackerTest, LostBeforeTheFirstMapArrivesItIsFoundByWhatItSawLast) {
  const KeyframePacket packet = start();
  track(Rigid3{});
  black = true;
  EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost);
  black = false;
  EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost) << "found, and yet to be confirmed";
  EXPECT_EQ(track(Rigid3{}).state, TrackingState::relocalised);
  publish(packet);
  EXPECT_EQ(track(Rigid3{}).state, TrackingState::tracking);
}

TEST_F(TrackerTest, LongAfterItWasLostACameraMayBeAnywhere) {
  start();
  track(Rigid3{});
  black = true;
  EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost);
  black = false;
  stalled = 10;
  for (int f = 0; f < 3; ++f) EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost);
}

TEST_F(TrackerTest, ATakenViewMovesPoseVelocityAndPendingKeyframesWithTheWorld) {
  publish(start(on_path(0)));
  TrackedFrame o;
  for (int f = 1; f <= 6; ++f) o = track(on_path(f));
  const KeyframePacket pending = insert(o);  // mapping is still at it
  o = track(on_path(7));
  const Vector6d velocity = tracker.velocity();
  const Rigid3 pending_before = tracker.map().cam_from_world(1);
  const PointId provisional = pending.new_points.front().id;
  const Eigen::Vector3d point_before = *tracker.position(provisional);

  const Rigid3 new_from_old(rotation_from_vector({0.02, -0.5, 0.3}), {0.4, 1.5, -0.2});
  map.set_pose(0, map.keyframe(0)->cam_from_world * new_from_old.inverse());
  for (PointId p : map.live_points()) map.edit_point(p).position = new_from_old * map.point(p)->position;
  const Rigid3 moved = publish();
  EXPECT_LT((moved.translation - new_from_old.translation).norm(), 1e-9);
  EXPECT_LT(moved.rotation.angularDistance(new_from_old.rotation), 1e-9);
  EXPECT_LT(distance_between(tracker.map().cam_from_world(1), pending_before * new_from_old.inverse()), 1e-9);
  EXPECT_LT((*tracker.position(provisional) - new_from_old * point_before).norm(), 1e-9);
  EXPECT_TRUE(tracker.velocity().isApprox(velocity)) << "it is measured in camera axes";

  o = track(on_path(8));
  ASSERT_EQ(o.state, TrackingState::tracking);
  EXPECT_LT(distance_between(o.cam_from_world, on_path(8) * new_from_old.inverse()), 1e-4);
}

TEST_F(TrackerTest, VelocityIsThatOfTheCameraPerSecond) {
  publish(start(on_path(0)));
  EXPECT_TRUE(tracker.velocity().isZero());
  for (int f = 1; f <= 9; ++f) track(on_path(f));
  const Rigid3 step = on_path(9) * on_path(8).inverse();
  Vector6d per_second;
  per_second << step.translation, vector_from_rotation(step.rotation);
  per_second /= kFrameTime;
  EXPECT_LT((tracker.velocity() - per_second).norm(), 0.01);
  EXPECT_NEAR(tracker.velocity().tail<3>().norm(), 0.3, 0.003);  // [rad/s] as the path turns
}

// Stamps of a driver under load come in bursts. A step over 1 ms is the noise of two poses.
TEST_F(TrackerTest, AStampRightAfterAnotherTellsNothingOfTheVelocity) {
  publish(start(on_path(0), kNoisy));
  for (int f = 1; f <= 5; ++f) track(on_path(f), kNoisy);
  const Vector6d before = tracker.velocity();
  for (int f = 6; f <= 10; ++f) {
    stalled -= kFrameTime - 0.001;
    ASSERT_EQ(track(on_path(5), kNoisy).state, TrackingState::tracking);
    EXPECT_LT((tracker.velocity() - before).norm(), 0.2) << f;
  }
}

TEST_F(TrackerTest, FeaturesAreMadeForTheExpectedVelocityAndAgainForTheMeasuredOne) {
  publish(start(on_path(0)));
  for (int f = 1; f <= 3; ++f) track(on_path(f));
  const Vector6d expected = tracker.velocity();
  ++index;
  const View seen = scene.look(on_path(5));  // twice as fast as before
  const FakeFeatures features(seen.features);
  track(features);
  const std::vector<Vector6d>& asked = features.asked;
  ASSERT_EQ(asked.size(), 2U);
  EXPECT_TRUE(asked[0].isApprox(expected));
  EXPECT_GT(asked[1].tail<3>().norm(), 0.55);  // at least the 0.6 rad/s of this step, up to rounding
  EXPECT_LT(asked[1].tail<3>().norm(), 0.80);
  EXPECT_NEAR(tracker.velocity().tail<3>().norm(), 0.6, 0.1);  // by what a turn is taken to change in a frame
}

TEST_F(TrackerTest, PosesHangOnTheirReferenceKeyframe) {
  publish(start(on_path(0)));
  TrackedFrame o;
  for (int f = 1; f <= 6; ++f) o = track(on_path(f));
  EXPECT_EQ(o.reference, 0);
  insert(o);
  o = track(on_path(7));
  EXPECT_LT(distance_between(o.cam_from_reference * tracker.map().cam_from_world(o.reference), o.cam_from_world),
            1e-12);
}

TEST_F(TrackerTest, AfterAResetOfMotionTheFrameIsFoundAnew) {
  tracker.reset_motion();
  publish(start(on_path(0)));
  track(on_path(1));
  tracker.reset_motion();
  track(on_path(7));
  const TrackedFrame o = track(on_path(8));
  EXPECT_EQ(o.state, TrackingState::relocalised);
  EXPECT_LT(distance_between(o.cam_from_world, on_path(8)), 1e-4);
}

TEST_F(TrackerTest, TheSameFramesGiveTheSameBits) {
  std::vector<Rigid3> runs[2];
  for (auto& poses : runs) {
    tracker = Tracker(scene.optics(), {}, 1);
    map = Map();
    keyframe_shows.clear();
    index = -1;
    publish(start(on_path(0), kNoisy));
    for (int f = 1; f <= 12; ++f) {
      black = f == 6;
      poses.push_back(track(on_path(f), kNoisy).cam_from_world);
    }
  }
  for (size_t i = 0; i < runs[0].size(); ++i) {
    EXPECT_EQ(runs[0][i].translation, runs[1][i].translation);
    EXPECT_EQ(runs[0][i].rotation.coeffs(), runs[1][i].rotation.coeffs());
  }
}

TEST_F(TrackerTest, ANewMapStartsWhereTheOldOneStaysOutOfSight) {
  TrackingOptions options;
  options.new_map_after = 3.5 * kFrameTime;  // [s] the fifth lost frame is four later than the first
  tracker = Tracker(scene.optics(), options, 1);
  publish(start(on_path(0)));
  const TrackedFrame last = track(on_path(1));
  const TestScene home = scene;
  scene = TestScene(700, 99);
  black = true;
  for (int f = 0; f < 20; ++f) EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost) << "the dark starts no map";
  black = false;
  for (int f = 0; f < 4; ++f) EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost);
  TrackedFrame o = track(Rigid3{});
  ASSERT_EQ(o.state, TrackingState::tracking);
  EXPECT_TRUE(o.starts_map);
  EXPECT_LT(distance_between(o.cam_from_world, last.cam_from_world), 1e-12) << "where it was seen last";
  const KeyframePacket packet = insert(o);
  EXPECT_EQ(packet.reference, kNoKeyframe);
  EXPECT_EQ(tracker.map().root(1), 1);
  EXPECT_EQ(track(on_path(1)).state, TrackingState::tracking) << "on provisional points";
  publish(packet);
  EXPECT_EQ(map.roots(), (std::vector<KeyframeId>{0, 1}));
  o = track(on_path(2));
  EXPECT_EQ(o.state, TrackingState::tracking);
  EXPECT_EQ(tracker.map().root(o.reference), 1);
  scene = home;
  o = track(on_path(2));
  EXPECT_EQ(o.state, TrackingState::relocalised) << "the old map is not forgotten";
  EXPECT_EQ(tracker.map().root(o.reference), 0);
  EXPECT_LT(distance_between(o.cam_from_world, on_path(2)), 1e-4);
  scene = TestScene(700, 99);
  stalled = 2;
  EXPECT_EQ(track(on_path(2)).state, TrackingState::lost) << "two seconds later its velocity is anyone's guess";
  o = track(on_path(2));
  EXPECT_EQ(o.state, TrackingState::relocalised);
  EXPECT_EQ(tracker.map().root(o.reference), 1);
}

TEST_F(TrackerTest, FramesThatCouldStartNoMapDoNotBeginTheWaitAnew) {
  TrackingOptions options;
  options.new_map_after = 3.5 * kFrameTime;
  tracker = Tracker(scene.optics(), options, 1);
  publish(start(on_path(0)));
  track(on_path(1));
  scene = TestScene(700, 99);
  for (int f = 0; f < 8; ++f) {
    black = f % 2 == 1;
    EXPECT_EQ(track(Rigid3{}).state, TrackingState::lost) << f;
  }
  black = false;
  EXPECT_TRUE(track(Rigid3{}).starts_map) << "after four frames' time with features, and as much without";
}

TEST_F(TrackerTest, ANewMapBeginsWhereTheCameraWasSuggestedToBe) {
  TrackingOptions options;
  options.new_map_after = 2.5 * kFrameTime;
  tracker = Tracker(scene.optics(), options, 1);
  publish(start(on_path(0)));
  track(on_path(1));
  const Rigid3 suggested = TestScene::camera_at({5, 0, -3}, {0, 1, 0});
  tracker.suggest({suggested, Matrix6d::Identity()});
  scene = TestScene(700, 99);
  TrackedFrame o;
  for (int f = 0; f < 4; ++f) o = track(Rigid3{});
  ASSERT_TRUE(o.starts_map);
  EXPECT_LT(distance_between(o.cam_from_world, suggested), 1e-12);
}

TEST_F(TrackerTest, AMapFromWhoseFirstFrameNothingFollowsBeginsAgain) {
  publish(start(on_path(0)));
  scene = TestScene(700, 99);
  const TrackedFrame o = track(on_path(0));
  ASSERT_EQ(o.state, TrackingState::tracking) << "nobody waits for a map of one frame";
  EXPECT_TRUE(o.starts_map);
  EXPECT_EQ(o.reference, 0) << "the same map";
  EXPECT_NEAR(std::sqrt(o.covariance(0, 0)), kSpeedSd * kFrameTime, 0.1 * kSpeedSd * kFrameTime)
      << "the camera may have moved meanwhile";
  const KeyframePacket packet = insert(o);
  EXPECT_EQ(packet.retracted.size(), map.point_count()) << "what the first frame made is gone";
  publish(packet);
  EXPECT_EQ(map.roots(), std::vector<KeyframeId>{0});
  EXPECT_EQ(track(on_path(1)).state, TrackingState::tracking);
  scene = TestScene(700, 5);
  EXPECT_EQ(track(on_path(2)).state, TrackingState::lost) << "of a map that was followed more is expected";
}

TEST_F(TrackerTest, AMapsFirstFrameIsMadeAnewWithoutTheCornersOfMovers) {
  ++index;
  view = scene.look({}, {});
  FakeFeatures seen(view.features);
  seen.motion.assign(view.features->size(), FeatureMotion::still);
  for (size_t f = 0; f < seen.motion.size(); f += 3) seen.motion[f] = FeatureMotion::on_mover;
  const TrackedFrame first = track(seen);
  ASSERT_TRUE(first.starts_map);
  ASSERT_LT(first.features->size(), view.features->size());
  KeyframePacket packet = insert(first);

  // At the velocity that the second frame tells, every tenth corner has no depth.
  auto straight = std::make_shared<RgbdFeatures>(*view.features);
  for (size_t f = 0; f < straight->size(); f += 10) straight->keypoints[f].depth = 0;
  const FakeFeatures anew(straight);
  ++index;
  view = scene.look(on_path(1), {});
  const FakeFeatures features(view.features);
  const TrackedFrame second = tracker.track(
      {.index = index, .timestamp = index * kFrameTime, .features = features, .start = &anew, .movers = true});
  ASSERT_TRUE(second.tracked());
  const size_t points = packet.new_points.size();
  tracker.remake(second, packet);
  EXPECT_LT(packet.new_points.size(), points);
  ASSERT_EQ(packet.features->size(), packet.points.size());
  for (const ProvisionalPoint& p : packet.new_points) {
    const auto f = static_cast<size_t>(birth_feature(p.id));
    EXPECT_EQ(packet.features->descriptors[f], p.descriptor);
    EXPECT_GT(packet.features->keypoints[f].depth, 0);
  }
  EXPECT_EQ(second.inliers,
            std::count_if(second.points.begin(), second.points.end(), [](PointId p) { return p != kNoPoint; }));
}

TEST_F(TrackerTest, WhereAllIsTakenForMovedTheMapIsFoundAllTheSame) {
  publish(start(on_path(0)));
  ++index;
  view = scene.look(on_path(1), {});
  FakeFeatures seen(view.features);
  seen.motion.assign(view.features->size(), FeatureMotion::on_mover);
  const TrackedFrame frame = track(seen);
  ASSERT_EQ(frame.state, TrackingState::tracking);
  EXPECT_FALSE(frame.starts_map);
  EXPECT_LT((frame.cam_from_world.inverse() * on_path(1)).translation.norm(), 0.005);
  for (size_t f = 0; f < frame.points.size(); ++f)
    EXPECT_NE(frame.points[f], kNoPoint) << "what shows nothing of the map makes no map points";
}

TEST_F(TrackerTest, ALostFrameTellsHowNearItCameToAPose) {
  TrackingOptions options;
  options.min_inliers = 5000;
  tracker = Tracker(scene.optics(), options, 1);
  start();
  const View next = scene.look(on_path(1), {.depth_share = 0.5});
  const TrackedFrame lost = tracker.track(
      {.index = ++index, .timestamp = kFrameTime, .features = FakeFeatures(next.features), .may_start_map = false});
  EXPECT_EQ(lost.state, TrackingState::lost);
  EXPECT_GT(lost.refused_inliers, 100);
  const auto& keypoints = next.features->keypoints;
  EXPECT_EQ(lost.with_depth,
            std::count_if(keypoints.begin(), keypoints.end(), [](const auto& k) { return k.depth > 0; }));
  EXPECT_LT(static_cast<size_t>(lost.with_depth), keypoints.size());
}

TEST_F(TrackerTest, WithoutLeaveNoMapIsStarted) {
  view = scene.look({});
  const FakeFeatures features(view.features);
  const TrackedFrame o = tracker.track({.features = features, .may_start_map = false});
  EXPECT_EQ(o.state, TrackingState::initialising);
  EXPECT_FALSE(o.starts_map);
  EXPECT_TRUE(tracker.track({.index = 1, .timestamp = kFrameTime, .features = features}).starts_map);
}

}  // namespace
}  // namespace dkb
