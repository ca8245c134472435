// SPDX-License-Identifier: Apache-2.0
// Which points a frame shows, and what mapping is told of them.
#include "dkb/tracking/tracker.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/tracking/tracker_test_fixture.h"

namespace dkb {
namespace {

TEST_F(TrackerTest, ProvisionalPointsMatchBeforeMappingPublishes) {
  start(on_path(0));
  for (int f = 1; f <= 3; ++f) {
    const TrackedFrame o = track(on_path(f));
    ASSERT_EQ(o.state, TrackingState::tracking);
    EXPECT_GT(o.inliers, 150);
    EXPECT_EQ(o.reference, 0);
  }
}

TEST_F(TrackerTest, ProvisionalPointsOfALaterKeyframeAddToTheMapBeforeMappingPublishes) {
  publish(start(on_path(0)));
  TrackedFrame o;
  for (int f = 1; f <= 25; ++f) o = track(on_path(f));
  const KeyframePacket packet = insert(o);
  EXPECT_GT(packet.new_points.size(), 30U);
  o = track(on_path(26));
  int of_the_new_one = 0;
  for (PointId p : o.points) of_the_new_one += p != kNoPoint && birth_keyframe(p) == 1;
  EXPECT_GT(of_the_new_one, static_cast<int>(packet.new_points.size()) / 2);
}

TEST_F(TrackerTest, WhatHasJustComeIntoViewHelpsFromTheNextFrameOn) {
  // A map of half the scene: the other half has no depth at the only keyframe.
  publish(start(on_path(0), {.depth_share = 0.6}));
  int shown = 0, guessed = 0;
  for (int f = 1; f <= 4; ++f) {
    const TrackedFrame o = track(on_path(f));
    ASSERT_EQ(o.state, TrackingState::tracking);
    EXPECT_LT(distance_between(o.cam_from_world, on_path(f)), 1e-3);
    shown = guessed = 0;
    for (size_t i = 0; i < o.points.size(); ++i) {
      if (!o.odometry[i]) continue;
      EXPECT_EQ(o.points[i], kNoPoint);
      ++shown;
      guessed += o.odometry[i]->guessed;
      const Eigen::Vector3d& truth = scene.points[static_cast<size_t>(view.shows[i])];
      EXPECT_LT((o.odometry[i]->point_in_world - truth).norm(), 0.01);
    }
  }
  EXPECT_GT(shown, 50);
  EXPECT_EQ(guessed, 0);
}

TEST_F(TrackerTest, AnOdometryPointThatMovesByThreePixelsStartsAnew) {
  publish(start(on_path(0), {.depth_share = 0.6}));
  TrackedFrame o;
  for (int f = 1; f <= 3; ++f) o = track(on_path(f));
  // Of the features of this frame that show an odometry point, the place of the one nearest to the image's middle.
  int mover = -1;
  double nearest = 1e9;
  for (size_t i = 0; i < o.points.size(); ++i) {
    const double distance = (o.features->keypoints[i].pixel - Eigen::Vector2f(320, 240)).norm();
    if (!o.odometry[i] || distance > nearest) continue;
    nearest = distance;
    mover = view.shows[i];
  }
  ASSERT_GE(mover, 0);
  const auto followed = [&](int frame) {
    const TrackedFrame seen = track(on_path(frame));
    for (size_t i = 0; i < seen.points.size(); ++i)
      if (view.shows[i] == mover) return seen.odometry[i].has_value();
    return false;
  };
  Eigen::Vector3d& place = scene.points[static_cast<size_t>(mover)];
  ASSERT_TRUE(followed(4));
  place.y() += 3 / scene.camera.fy * (on_path(4) * place).z();
  EXPECT_FALSE(followed(5)) << "within the limit of an inlier whose sigma is doubled";
  EXPECT_TRUE(followed(6)) << "it stands still now";
}

TEST_F(TrackerTest, AKeyframeTurnsOdometryPointsIntoMapPoints) {
  publish(start(on_path(0), {.depth_share = 0.6}));
  track(on_path(1));
  const TrackedFrame second = track(on_path(2));
  const KeyframePacket packet = insert(second);
  EXPECT_GT(packet.new_points.size(), 50u);
  const TrackedFrame third = track(on_path(3));
  for (size_t i = 0; i < third.points.size(); ++i) EXPECT_FALSE(third.points[i] != kNoPoint && third.odometry[i]);
  EXPECT_GT(third.inliers, second.inliers + 50);
}

// Odometry points are named after the features of the last frame; a map that starts anew has other features.
TEST_F(TrackerTest, ALossEndsOdometryPointsBeforeAnotherMapStarts) {
  publish(start(on_path(0), {.depth_share = 0.6}));
  track(on_path(1));
  const TrackedFrame before = track(on_path(2));
  int followed = 0;
  for (const auto& o : before.odometry) followed += o.has_value();
  ASSERT_GT(followed, 50);
  // Elsewhere, with few features: what is left over would name features that are not there.
  scene = TestScene(400, 99);
  TrackedFrame o;
  for (int f = 0; f < 40 && !o.starts_map; ++f) o = track(on_path(0));
  ASSERT_TRUE(o.starts_map);
  publish(insert(o));
  const TrackedFrame next = track(on_path(0));
  ASSERT_EQ(next.state, TrackingState::tracking);
  for (const auto& left : next.odometry) EXPECT_FALSE(left.has_value());
}

TEST_F(TrackerTest, RetractedPointsAreNeverMatchedAgain) {
  publish(start(on_path(0)));
  TrackedFrame o = track(on_path(1));
  std::vector<PointId> moving;
  for (PointId p : o.points)
    if (p != kNoPoint && scene_point(p) % 3 == 0) moving.push_back(p);
  ASSERT_GT(moving.size(), 50U);
  tracker.retract(moving);
  const auto shows_a_retracted_one = [&] {
    return std::any_of(o.points.begin(), o.points.end(),
                       [&](PointId p) { return std::find(moving.begin(), moving.end(), p) != moving.end(); });
  };
  for (int f = 2; f <= 5; ++f) {
    o = track(on_path(f));
    ASSERT_EQ(o.state, TrackingState::tracking);
    EXPECT_FALSE(shows_a_retracted_one()) << "frame " << f;
  }
  black = true;
  track(Rigid3{});
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
  const TrackedFrame o = track(on_path(1));
  EXPECT_EQ(insert(o).retracted, moving);
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
    const TrackedFrame o = track(on_path(f));
    EXPECT_EQ(std::count(o.points.begin(), o.points.end(), moving), 0);
  }
}

TEST_F(TrackerTest, TellsThePointsThatItsPosePutsInView) {
  publish(start(on_path(0)));
  track(on_path(1));
  const TrackedFrame o = track(on_path(2));
  std::vector<PointId> seen;
  for (const PointInView& p : tracker.points_in_view()) {
    const Eigen::Vector3d in_cam = on_path(2) * scene.points[static_cast<size_t>(scene_point(p.id))];
    EXPECT_LT((scene.camera.project(in_cam) - p.image_pixel).norm(), 0.05);
    EXPECT_NEAR(in_cam.z(), p.depth, 1e-3);
    seen.push_back(p.id);
  }
  for (PointId p : o.points) EXPECT_TRUE(p == kNoPoint || std::find(seen.begin(), seen.end(), p) != seen.end());
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
  const TrackedFrame o = track(on_path(2));
  ASSERT_EQ(o.state, TrackingState::tracking);
  for (PointId p : o.points) EXPECT_TRUE(p != dropped && p != fused);
}

TEST_F(TrackerTest, VisibilityCountsWhatWasInViewAndWhatWasMatched) {
  publish(start());
  const int hidden = scene_point(map.live_points()[3]);
  TrackedFrame o;
  for (int f = 0; f < 10; ++f) {
    o = track(Rigid3{}, {.hidden = hidden});
  }
  const KeyframePacket packet = insert(o);
  ASSERT_GT(packet.visibility.size(), 100U);
  for (size_t i = 0; i < packet.visibility.size(); ++i) {
    const PointVisibility& s = packet.visibility[i];
    if (i > 0) {
      EXPECT_LT(packet.visibility[i - 1].point, s.point);
    }
    EXPECT_LE(s.found, s.visible);
    if (scene_point(s.point) == hidden) {
      EXPECT_EQ(s.found, 0);
      EXPECT_GE(s.visible, 9);
    } else {
      EXPECT_EQ(s.found, 10);
    }
  }
  EXPECT_TRUE(insert(track(Rigid3{})).visibility.size() < 2 * packet.visibility.size());
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
    EXPECT_EQ(birth_keyframe(p.id), 0);
    EXPECT_LT((p.point_in_keyframe - scene.points[static_cast<size_t>(scene_point(p.id))]).norm(), 1e-4);
  }
}

TEST_F(TrackerTest, CountsTheReferencesPoints) {
  const KeyframePacket packet = start();
  const int points = static_cast<int>(packet.new_points.size());
  EXPECT_EQ(tracker.reference_point_count(0), points) << "provisional ones";
  publish(packet);
  EXPECT_EQ(tracker.reference_point_count(0), points) << "one keyframe sees them, and it has no neighbours";
  EXPECT_EQ(tracker.reference_point_count(7), 0);
}

TEST_F(TrackerTest, FusedPointsAreShownByOneFeature) {
  publish(start());
  const TrackedFrame o = track(Rigid3{});
  std::vector<PointId> shown;
  for (PointId p : o.points)
    if (p != kNoPoint) shown.push_back(p);
  map.fuse(shown[3], shown[7]);
  publish();
  const auto& points = tracker.last_frame()->points;
  EXPECT_EQ(std::count(points.begin(), points.end(), shown[7]), 1);
  EXPECT_EQ(std::count(points.begin(), points.end(), shown[3]), 0);
}

}  // namespace
}  // namespace dkb
