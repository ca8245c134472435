// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/tracker.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/tracking/test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr double kFrameTime = 1.0 / 30;  // [s]

const ViewOptions kNoisy{
    .pixel_noise = 0.5, .depth_noise = 0.01, .depth_share = 0.8, .flipped_bits = 20, .clutter = 200, .misplaced = 0.1};

class TrackerTest : public ::testing::Test {
 protected:
  TrackOutcome track(const Rigid3& cam_from_world, ViewOptions options = {}) {
    ++index;
    options.seed = options.seed * 1000 + static_cast<uint64_t>(index);
    view = scene.look(cam_from_world, options);
    if (black) view.features = std::make_shared<RgbdFeatures>();
    return tracker.track(index, index * kFrameTime, [&](const Vector6d&) { return view.features; });
  }
  // The first frame and its keyframe.
  KeyframePacket start(const Rigid3& cam_from_world = {}, const ViewOptions& options = {}) {
    TrackOutcome first = track(cam_from_world, options);
    EXPECT_TRUE(first.wants_first_keyframe);
    first.frame.cam_from_world = cam_from_world;
    return insert(first.frame);
  }
  KeyframePacket insert(const TrackedFrame& frame) {
    keyframe_shows.push_back(view.shows);
    return tracker.make_keyframe(static_cast<KeyframeId>(keyframe_shows.size()) - 1, frame);
  }
  // What mapping would do, without any refinement.
  void work_in(const KeyframePacket& packet) {
    Keyframe k;
    k.id = packet.id;
    k.features = packet.features;
    k.points = packet.points;
    k.parent = packet.reference;
    k.cam_from_world = packet.reference == kNoKeyframe
                           ? packet.cam_from_reference
                           : packet.cam_from_reference * map.cam_from_world(packet.reference);
    const Rigid3 world_from_cam = k.cam_from_world.inverse();
    map.add_keyframe(std::move(k));
    for (const ProvisionalPoint& n : packet.new_points) {
      MapPoint p;
      p.id = n.id;
      p.position = world_from_cam * n.point_in_keyframe;
      p.reference_distance = static_cast<float>(n.point_in_keyframe.norm());
      p.reference_scale = n.scale;
      p.descriptor = n.descriptor;
      map.add_point(p);
      map.observe(n.id, packet.id, n.feature);
    }
    map.update_covisibility(packet.id, 1);
  }
  Rigid3 publish() { return tracker.take_view(map.snapshot()); }
  Rigid3 publish(const KeyframePacket& packet) {
    work_in(packet);
    return publish();
  }
  // The scene's point behind a map point, by the keyframe and feature that it is named after.
  int scene_point(PointId id) const {
    return keyframe_shows[static_cast<size_t>(birth_keyframe(id))][static_cast<size_t>(birth_feature(id))];
  }
  // Hand-held: 0.6 m/s to the right, 0.3 rad/s about the vertical axis.
  static Rigid3 on_path(double frames) {
    return TestScene::camera_at({0.02 * frames, 0.005 * frames, 0}, {0, 0.01 * frames, 0});
  }

  TestScene scene{700};
  Tracker tracker{scene.camera, {}, TestScene::kScaleFactor, TestScene::kLevels, {}, 1};
  Map map;
  View view;  // of the last frame
  std::vector<std::vector<int>> keyframe_shows;
  FrameIndex index = -1;
  bool black = false;
};

TEST_F(TrackerTest, AMapStartsOnceEnoughFeaturesHaveDepth) {
  const TrackOutcome blind = track({}, {.depth_share = 0});
  EXPECT_EQ(blind.state, TrackingState::initialising);
  EXPECT_FALSE(blind.wants_first_keyframe);
  const TrackOutcome first = track({});
  EXPECT_EQ(first.state, TrackingState::tracking);
  EXPECT_TRUE(first.wants_first_keyframe);
}

TEST_F(TrackerTest, FollowsASteadyMotionThroughNoiseAndOutliers) {
  publish(start(on_path(0), kNoisy));
  for (int f = 1; f <= 30; ++f) {
    const TrackOutcome o = track(on_path(f), kNoisy);
    ASSERT_EQ(o.state, TrackingState::tracking) << "frame " << f;
    EXPECT_GT(o.frame.inliers, 50);
    EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(f)), 0.015) << "frame " << f;
    EXPECT_LT(turn_between(o.frame.cam_from_world, on_path(f)), 0.3) << "frame " << f;
    int inliers = 0;
    for (size_t i = 0; i < o.frame.points.size(); ++i) {
      if (o.frame.points[i] == kNoPoint) continue;
      ++inliers;
      EXPECT_FALSE(o.frame.outlier[i]);
      ASSERT_EQ(scene_point(o.frame.points[i]), view.shows[i]) << "frame " << f << " feature " << i;
    }
    EXPECT_EQ(inliers, o.frame.inliers);
  }
}

TEST_F(TrackerTest, ExactViewsGiveExactPoses) {
  publish(start());
  for (int f = 1; f <= 5; ++f) {
    const TrackOutcome o = track(on_path(f));
    EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(f)), 1e-5);
    EXPECT_LT(turn_between(o.frame.cam_from_world, on_path(f)), 1e-3);
  }
}

TEST_F(TrackerTest, ProvisionalPointsMatchBeforeMappingPublishes) {
  start(on_path(0));
  for (int f = 1; f <= 3; ++f) {
    const TrackOutcome o = track(on_path(f));
    ASSERT_EQ(o.state, TrackingState::tracking);
    EXPECT_GT(o.frame.inliers, 150);
    EXPECT_EQ(o.frame.reference, 0);
  }
}

TEST_F(TrackerTest, ProvisionalPointsOfALaterKeyframeAddToTheMapBeforeMappingPublishes) {
  publish(start(on_path(0)));
  TrackOutcome o;
  for (int f = 1; f <= 25; ++f) o = track(on_path(f));
  const KeyframePacket packet = insert(o.frame);
  EXPECT_GT(packet.new_points.size(), 30U);
  o = track(on_path(26));
  int of_the_new_one = 0;
  for (PointId p : o.frame.points) of_the_new_one += p != kNoPoint && birth_keyframe(p) == 1;
  EXPECT_GT(of_the_new_one, static_cast<int>(packet.new_points.size()) / 2);
}

TEST_F(TrackerTest, TheFirstKeyframeMayStandAnywhere) {
  const Rigid3 mounted = TestScene::camera_at({0.3, -0.2, 0.4}, {0.1, 0.2, -0.1});
  start(mounted);
  const Rigid3 next = TestScene::camera_at({0.31, -0.2, 0.4}, {0.1, 0.2, -0.1});
  const TrackOutcome o = track(next);
  ASSERT_EQ(o.state, TrackingState::tracking);
  EXPECT_LT(distance_between(o.frame.cam_from_world, next), 1e-5);
  const Rigid3 moved = tracker.take_view(std::make_shared<const Map>());
  EXPECT_LT(moved.translation.norm(), 1e-9) << "nothing moved the world";
}

TEST_F(TrackerTest, WhatHasJustComeIntoViewHelpsFromTheNextFrameOn) {
  // A map of half the scene: the other half has no depth at the only keyframe.
  publish(start(on_path(0), {.depth_share = 0.5}));
  int shown = 0, guessed = 0;
  for (int f = 1; f <= 4; ++f) {
    const TrackOutcome o = track(on_path(f));
    ASSERT_EQ(o.state, TrackingState::tracking);
    EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(f)), 1e-3);
    shown = guessed = 0;
    for (size_t i = 0; i < o.frame.points.size(); ++i) {
      if (!o.frame.odometry[i]) continue;
      EXPECT_EQ(o.frame.points[i], kNoPoint);
      ++shown;
      guessed += o.frame.odometry[i]->guessed;
      const Eigen::Vector3d& truth = scene.points[static_cast<size_t>(view.shows[i])];
      EXPECT_LT((o.frame.odometry[i]->point_in_world - truth).norm(), 0.01);
    }
  }
  EXPECT_GT(shown, 50);
  EXPECT_EQ(guessed, 0);
}

TEST_F(TrackerTest, AKeyframeTurnsOdometryPointsIntoMapPoints) {
  publish(start(on_path(0), {.depth_share = 0.5}));
  track(on_path(1));
  const TrackOutcome second = track(on_path(2));
  const KeyframePacket packet = insert(second.frame);
  EXPECT_GT(packet.new_points.size(), 50u);
  const TrackOutcome third = track(on_path(3));
  for (size_t i = 0; i < third.frame.points.size(); ++i)
    EXPECT_FALSE(third.frame.points[i] != kNoPoint && third.frame.odometry[i]);
  EXPECT_GT(third.frame.inliers, second.frame.inliers + 50);
}

// Two frames, a turn of 3 degrees between them and no notion of it: the narrow search would find wrong matches only.
TEST_F(TrackerTest, FollowsACameraThatTurnsFastFromTheVeryFirstFrame) {
  start({}, kNoisy);
  for (int f = 1; f <= 5; ++f) {
    const Rigid3 truth = TestScene::camera_at({0, 0, 0}, {0, 0.06 * f, 0});
    const TrackOutcome o = track(truth, kNoisy);
    ASSERT_EQ(o.state, TrackingState::tracking) << f;
    EXPECT_LT(distance_between(o.frame.cam_from_world, truth), 0.02) << f;
    EXPECT_LT(turn_between(o.frame.cam_from_world, truth), 0.4) << f;
  }
}

// Odometry points are named after the features of the last frame; a map that starts anew has other features.
TEST_F(TrackerTest, ALossEndsOdometryPointsBeforeAnotherMapStarts) {
  publish(start(on_path(0), {.depth_share = 0.5}));
  track(on_path(1));
  const TrackOutcome before = track(on_path(2));
  int followed = 0;
  for (const auto& o : before.frame.odometry) followed += o.has_value();
  ASSERT_GT(followed, 50);
  // Elsewhere, with few features: what is left over would name features that are not there.
  scene = TestScene(400, 99);
  TrackOutcome o;
  for (int f = 0; f < 40 && !o.wants_first_keyframe; ++f) o = track(on_path(0));
  ASSERT_TRUE(o.wants_first_keyframe);
  publish(insert(o.frame));
  const TrackOutcome next = track(on_path(0));
  ASSERT_EQ(next.state, TrackingState::tracking);
  for (const auto& left : next.frame.odometry) EXPECT_FALSE(left.has_value());
}

TEST_F(TrackerTest, RetractedPointsAreNeverMatchedAgain) {
  publish(start(on_path(0)));
  TrackOutcome o = track(on_path(1));
  std::vector<PointId> moving;
  for (PointId p : o.frame.points)
    if (p != kNoPoint && scene_point(p) % 3 == 0) moving.push_back(p);
  ASSERT_GT(moving.size(), 50U);
  tracker.retract(moving);
  const auto shows_a_retracted_one = [&] {
    return std::any_of(o.frame.points.begin(), o.frame.points.end(),
                       [&](PointId p) { return std::find(moving.begin(), moving.end(), p) != moving.end(); });
  };
  for (int f = 2; f <= 5; ++f) {
    o = track(on_path(f));
    ASSERT_EQ(o.state, TrackingState::tracking);
    EXPECT_FALSE(shows_a_retracted_one()) << "frame " << f;
  }
  black = true;
  track({});
  black = false;
  track(on_path(6));
  o = track(on_path(6));
  ASSERT_EQ(o.state, TrackingState::relocalised);
  EXPECT_FALSE(shows_a_retracted_one()) << "found again";
}

TEST_F(TrackerTest, MappingIsToldOnceOfRetractedPoints) {
  publish(start(on_path(0)));
  const std::vector<PointId> live = map.live_points();
  const std::vector<PointId> moving = {live[7], live[3]};
  tracker.retract(moving);
  tracker.retract({live[3]});
  const TrackOutcome o = track(on_path(1));
  EXPECT_EQ(insert(o.frame).retracted, moving);
  tracker.retract({live[9]});
  const KeyframePacket report = tracker.make_report();
  EXPECT_EQ(report.id, kNoKeyframe);
  EXPECT_EQ(report.retracted, std::vector<PointId>{live[9]});
  EXPECT_TRUE(tracker.make_report().retracted.empty());
}

TEST_F(TrackerTest, ARetractedProvisionalPointIsGoneAtOnceAndAfterMappingPublishedIt) {
  const KeyframePacket packet = start(on_path(0));
  const PointId moving = packet.new_points[10].id;
  tracker.retract({moving});
  EXPECT_FALSE(tracker.position(moving));
  publish(packet);  // mapping did not know yet
  for (int f = 1; f <= 3; ++f) {
    const TrackOutcome o = track(on_path(f));
    EXPECT_EQ(std::count(o.frame.points.begin(), o.frame.points.end(), moving), 0);
  }
}

TEST_F(TrackerTest, VisitsThePointsThatItsPosePutsInView) {
  publish(start(on_path(0)));
  track(on_path(1));
  const TrackOutcome o = track(on_path(2));
  std::vector<PointId> seen;
  tracker.visit_points_in_view([&](PointId id, const Eigen::Vector2d& pixel, double depth) {
    const Eigen::Vector3d in_cam = on_path(2) * scene.points[static_cast<size_t>(scene_point(id))];
    EXPECT_LT((scene.camera.project(in_cam) - pixel).norm(), 0.05);
    EXPECT_NEAR(in_cam.z(), depth, 1e-3);
    seen.push_back(id);
  });
  for (PointId p : o.frame.points) EXPECT_TRUE(p == kNoPoint || std::find(seen.begin(), seen.end(), p) != seen.end());
}

TEST_F(TrackerTest, IsLostInTheDarkAndRecoversWhenTheViewReturns) {
  publish(start(on_path(0), kNoisy));
  for (int f = 1; f <= 5; ++f) track(on_path(f), kNoisy);
  black = true;
  for (int f = 0; f < 5; ++f) {
    const TrackOutcome o = track(on_path(5));
    EXPECT_EQ(o.state, TrackingState::lost);
    EXPECT_TRUE(tracker.velocity().isZero());
  }
  black = false;
  const Rigid3 elsewhere = on_path(12);
  EXPECT_EQ(track(on_path(11), kNoisy).state, TrackingState::lost) << "it has to be confirmed";
  TrackOutcome o = track(elsewhere, kNoisy);
  EXPECT_EQ(o.state, TrackingState::relocalised);
  EXPECT_LT(distance_between(o.frame.cam_from_world, elsewhere), 0.015);
  o = track(on_path(13), kNoisy);
  EXPECT_EQ(o.state, TrackingState::tracking);
  EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(13)), 0.015);
}

TEST_F(TrackerTest, AnotherPlaceIsNotMistakenForTheMap) {
  publish(start());
  const TestScene other(700, 99);
  for (int f = 0; f < 3; ++f) {
    ++index;
    const View there = other.look(on_path(f));
    EXPECT_EQ(tracker.track(index, index * kFrameTime, [&](const Vector6d&) { return there.features; }).state,
              TrackingState::lost);
  }
}

TEST_F(TrackerTest, LostBeforeTheFirstMapArrivesItWaitsForIt) {
  const KeyframePacket packet = start();
  black = true;
  EXPECT_EQ(track({}).state, TrackingState::lost);
  black = false;
  EXPECT_EQ(track({}).state, TrackingState::lost);
  publish(packet);
  EXPECT_EQ(track({}).state, TrackingState::lost) << "found, and yet to be confirmed";
  EXPECT_EQ(track({}).state, TrackingState::relocalised);
}

TEST_F(TrackerTest, ATakenViewMovesPoseVelocityAndPendingKeyframesWithTheWorld) {
  publish(start(on_path(0)));
  TrackOutcome o;
  for (int f = 1; f <= 6; ++f) o = track(on_path(f));
  const KeyframePacket pending = insert(o.frame);  // mapping is still at it
  o = track(on_path(7));
  const Vector6d velocity = tracker.velocity();
  const Rigid3 pending_before = tracker.keyframe_pose(1);
  const PointId provisional = pending.new_points.front().id;
  const Eigen::Vector3d point_before = *tracker.position(provisional);

  const Rigid3 new_from_old(rotation_from_vector({0.02, -0.5, 0.3}), {0.4, 1.5, -0.2});
  map.set_pose(0, map.keyframe(0)->cam_from_world * new_from_old.inverse());
  for (PointId p : map.live_points()) map.edit_point(p).position = new_from_old * map.point(p)->position;
  const Rigid3 moved = publish();
  EXPECT_LT((moved.translation - new_from_old.translation).norm(), 1e-9);
  EXPECT_LT(moved.rotation.angularDistance(new_from_old.rotation), 1e-9);
  EXPECT_LT(distance_between(tracker.keyframe_pose(1), pending_before * new_from_old.inverse()), 1e-9);
  EXPECT_LT((*tracker.position(provisional) - new_from_old * point_before).norm(), 1e-9);
  EXPECT_TRUE(tracker.velocity().isApprox(velocity)) << "it is measured in camera axes";

  o = track(on_path(8));
  ASSERT_EQ(o.state, TrackingState::tracking);
  EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(8) * new_from_old.inverse()), 1e-4);
}

TEST_F(TrackerTest, APublishedKeyframeTakesItsProvisionalPointsOver) {
  const KeyframePacket packet = start(on_path(0));
  track(on_path(1));
  work_in(packet);
  const PointId dropped = packet.new_points[0].id, fused = packet.new_points[1].id, survivor = packet.new_points[2].id;
  map.remove_point(dropped);
  map.fuse(fused, survivor);
  publish();
  EXPECT_FALSE(tracker.position(dropped));
  EXPECT_FALSE(tracker.position(fused));
  EXPECT_TRUE(tracker.position(survivor));
  const TrackOutcome o = track(on_path(2));
  ASSERT_EQ(o.state, TrackingState::tracking);
  for (PointId p : o.frame.points) EXPECT_TRUE(p != dropped && p != fused);
}

TEST_F(TrackerTest, VelocityIsThatOfTheCameraPerSecond) {
  publish(start(on_path(0)));
  EXPECT_TRUE(tracker.velocity().isZero());
  for (int f = 1; f <= 3; ++f) track(on_path(f));
  const Rigid3 step = on_path(3) * on_path(2).inverse();
  Vector6d per_second;
  per_second << step.translation, vector_from_rotation(step.rotation);
  per_second /= kFrameTime;
  EXPECT_LT((tracker.velocity() - per_second).norm(), 1e-3);
  EXPECT_NEAR(tracker.velocity().tail<3>().norm(), 0.3, 1e-3);  // [rad/s] as the path turns
  const Rigid3 two_steps = tracker.expected_motion(2 * kFrameTime);
  EXPECT_NEAR(vector_from_rotation(two_steps.rotation).norm(), 0.02, 1e-4);
}

TEST_F(TrackerTest, FeaturesAreMadeForTheExpectedVelocityAndAgainForTheMeasuredOne) {
  publish(start(on_path(0)));
  for (int f = 1; f <= 3; ++f) track(on_path(f));
  const Vector6d expected = tracker.velocity();
  ++index;
  const View seen = scene.look(on_path(5));  // twice as fast as before
  std::vector<Vector6d> asked;
  tracker.track(index, index * kFrameTime, [&](const Vector6d& velocity) {
    asked.push_back(velocity);
    return seen.features;
  });
  ASSERT_EQ(asked.size(), 2U);
  EXPECT_TRUE(asked[0].isApprox(expected));
  EXPECT_GT(asked[1].tail<3>().norm(), 0.55);  // at least the 0.6 rad/s of this step, up to rounding
  EXPECT_LT(asked[1].tail<3>().norm(), 0.80);
  EXPECT_NEAR(tracker.velocity().tail<3>().norm(), 0.6, 0.01);
}

TEST_F(TrackerTest, PosesHangOnTheirReferenceKeyframe) {
  publish(start(on_path(0)));
  TrackOutcome o;
  for (int f = 1; f <= 6; ++f) o = track(on_path(f));
  EXPECT_EQ(o.frame.reference, 0);
  insert(o.frame);
  o = track(on_path(7));
  EXPECT_LT(
      distance_between(o.frame.cam_from_reference * tracker.keyframe_pose(o.frame.reference), o.frame.cam_from_world),
      1e-12);
}

TEST_F(TrackerTest, SightingsCountWhatWasInViewAndWhatWasMatched) {
  publish(start());
  const int hidden = scene_point(map.live_points()[3]);
  TrackOutcome o;
  for (int f = 0; f < 10; ++f) {
    o = track({}, {.hidden = hidden});
  }
  const KeyframePacket packet = insert(o.frame);
  ASSERT_GT(packet.sightings.size(), 100U);
  for (size_t i = 0; i < packet.sightings.size(); ++i) {
    const PointSighting& s = packet.sightings[i];
    if (i > 0) {
      EXPECT_LT(packet.sightings[i - 1].point, s.point);
    }
    EXPECT_LE(s.found, s.visible);
    if (scene_point(s.point) == hidden) {
      EXPECT_EQ(s.found, 0);
      EXPECT_GE(s.visible, 9);
    } else {
      EXPECT_EQ(s.found, 10);
    }
  }
  EXPECT_TRUE(insert(track({}).frame).sightings.size() < 2 * packet.sightings.size());
}

TEST_F(TrackerTest, FarDepthsMakePointsOnlyWhenCloseOnesAreFew) {
  scene = TestScene(900, 2, 7.0, 11.0);  // all beyond the close depth of 6 m
  const KeyframePacket far = start();
  EXPECT_EQ(far.new_points.size(), 100U);
  double farthest = 0;
  for (const ProvisionalPoint& p : far.new_points) farthest = std::max(farthest, p.point_in_keyframe.z());
  std::vector<double> depths;
  for (const Keypoint& k : view.features->keypoints) depths.push_back(k.depth);
  std::sort(depths.begin(), depths.end());
  EXPECT_NEAR(farthest, depths[99], 1e-5) << "the nearest ones";
}

TEST_F(TrackerTest, AllCloseDepthsMakePoints) {
  const KeyframePacket close = start();
  EXPECT_EQ(close.new_points.size(), view.shows.size());
  for (const ProvisionalPoint& p : close.new_points) {
    EXPECT_EQ(p.id, make_point_id(0, p.feature));
    EXPECT_LT((p.point_in_keyframe - scene.points[static_cast<size_t>(scene_point(p.id))]).norm(), 1e-4);
  }
}

TEST_F(TrackerTest, CountsTheReferencesPoints) {
  const KeyframePacket packet = start();
  const int points = static_cast<int>(packet.new_points.size());
  EXPECT_EQ(tracker.reference_point_count(0, 1), points) << "provisional ones";
  publish(packet);
  EXPECT_EQ(tracker.reference_point_count(0, 1), points);
  EXPECT_EQ(tracker.reference_point_count(0, 2), 0) << "one keyframe sees them";
  EXPECT_EQ(tracker.reference_point_count(7, 1), 0);
}

TEST_F(TrackerTest, AfterAResetOfMotionTheFrameIsFoundAnew) {
  tracker.reset_motion();
  publish(start(on_path(0)));
  track(on_path(1));
  tracker.reset_motion();
  track(on_path(7));
  const TrackOutcome o = track(on_path(8));
  EXPECT_EQ(o.state, TrackingState::relocalised);
  EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(8)), 1e-4);
}

TEST_F(TrackerTest, TheSameFramesGiveTheSameBits) {
  std::vector<Rigid3> runs[2];
  for (auto& poses : runs) {
    tracker = Tracker(scene.camera, {}, TestScene::kScaleFactor, TestScene::kLevels, {}, 1);
    map = Map();
    keyframe_shows.clear();
    index = -1;
    publish(start(on_path(0), kNoisy));
    for (int f = 1; f <= 12; ++f) {
      black = f == 6;
      poses.push_back(track(on_path(f), kNoisy).frame.cam_from_world);
    }
  }
  for (size_t i = 0; i < runs[0].size(); ++i) {
    EXPECT_EQ(runs[0][i].translation, runs[1][i].translation);
    EXPECT_EQ(runs[0][i].rotation.coeffs(), runs[1][i].rotation.coeffs());
  }
}

TEST_F(TrackerTest, ANewMapStartsWhereTheOldOneStaysOutOfSight) {
  TrackingOptions options;
  options.new_map_after = 5;
  tracker = Tracker(scene.camera, {}, TestScene::kScaleFactor, TestScene::kLevels, options, 1);
  publish(start(on_path(0)));
  const TrackOutcome last = track(on_path(1));
  const TestScene home = scene;
  scene = TestScene(700, 99);
  black = true;
  for (int f = 0; f < 20; ++f) EXPECT_EQ(track({}).state, TrackingState::lost) << "the dark starts no map";
  black = false;
  for (int f = 0; f < 4; ++f) EXPECT_EQ(track({}).state, TrackingState::lost);
  TrackOutcome o = track({});
  ASSERT_EQ(o.state, TrackingState::tracking);
  EXPECT_TRUE(o.wants_first_keyframe);
  EXPECT_LT(distance_between(o.frame.cam_from_world, last.frame.cam_from_world), 1e-12) << "where it was seen last";
  const KeyframePacket packet = insert(o.frame);
  EXPECT_EQ(packet.reference, kNoKeyframe);
  EXPECT_EQ(tracker.root(1), 1);
  EXPECT_EQ(track(on_path(1)).state, TrackingState::tracking) << "on provisional points";
  publish(packet);
  EXPECT_EQ(map.roots(), (std::vector<KeyframeId>{0, 1}));
  o = track(on_path(2));
  EXPECT_EQ(o.state, TrackingState::tracking);
  EXPECT_EQ(tracker.root(o.frame.reference), 1);
  scene = home;
  o = track(on_path(2));
  EXPECT_EQ(o.state, TrackingState::relocalised) << "the old map is not forgotten";
  EXPECT_EQ(tracker.root(o.frame.reference), 0);
  EXPECT_LT(distance_between(o.frame.cam_from_world, on_path(2)), 1e-4);
}

TEST_F(TrackerTest, WithoutLeaveNoMapIsStarted) {
  view = scene.look({});
  const auto features_at = [&](const Vector6d&) { return view.features; };
  const TrackOutcome o = tracker.track(0, 0, features_at, false);
  EXPECT_EQ(o.state, TrackingState::initialising);
  EXPECT_FALSE(o.wants_first_keyframe);
  EXPECT_TRUE(tracker.track(1, kFrameTime, features_at).wants_first_keyframe);
}

TEST_F(TrackerTest, FusedPointsAreShownByOneFeature) {
  publish(start());
  const TrackOutcome o = track({});
  std::vector<PointId> shown;
  for (PointId p : o.frame.points)
    if (p != kNoPoint) shown.push_back(p);
  map.fuse(shown[3], shown[7]);
  publish();
  const auto& points = tracker.last_frame()->points;
  EXPECT_EQ(std::count(points.begin(), points.end(), shown[7]), 1);
  EXPECT_EQ(std::count(points.begin(), points.end(), shown[3]), 0);
}

TEST(TrackingOptions, AreChecked) {
  const auto rejects = [](auto change) {
    TrackingOptions options;
    change(options);
    EXPECT_THROW(options.check(), InvalidOption);
  };
  rejects([](auto& o) { o.initial_points = 9; });
  rejects([](auto& o) { o.least_matches = 5; });
  rejects([](auto& o) { o.close_depth = 0; });
  rejects([](auto& o) { o.radius_local_map = -1; });
  rejects([](auto& o) { o.match_distance = 257; });
  rejects([](auto& o) { o.match_ratio = 1.5; });
  rejects([](auto& o) { o.local_map.keyframes = 0; });
  rejects([](auto& o) { o.new_map_after = -1; });
  rejects([](auto& o) { o.relocalisation.candidates = 0; });
  rejects([](auto& o) { o.relocalisation.least_share = 1.1; });
  EXPECT_NO_THROW(TrackingOptions().check());
}

}  // namespace
}  // namespace dkb
