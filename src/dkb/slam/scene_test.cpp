// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/scene.h"

#include <gtest/gtest.h>

#include "dkb/image/test_frame.h"
#include "dkb/tracking/frame.h"

namespace dkb {
namespace {

// A scene of a wall at 2 m with corners in a row, 20 px apart from x = 10; `rejected` says why, corner by corner.
Scene scene_with(const std::vector<FeatureReason>& rejected) {
  auto image = std::make_shared<RgbdImage>();
  image->grey = GreyImage(320, 240);
  image->depth = DepthImage(320, 240, 2.0f);
  Scene scene;
  scene.extracted.frame = frame_of(std::move(image));
  scene.rejected = rejected;
  for (size_t i = 0; i < rejected.size(); ++i) {
    Corner corner;
    corner.x = 10 + 20 * static_cast<float>(i);
    corner.y = 100;
    scene.extracted.orb.corners.push_back(corner);
    scene.extracted.orb.descriptors.push_back({i, 0, 0, 0});
  }
  return scene;
}

constexpr FeatureReason kNone = FeatureReason::none, kOnMover = FeatureReason::on_mover, kMoved = FeatureReason::moved;

TEST(UsableFeatures, AreAllButThoseThatARivalFilterRejected) {
  const Scene scene = scene_with({kNone, kMoved, kOnMover, kMoved, kNone});
  const UsableFeatures usable = usable_features(scene);
  EXPECT_EQ(usable.corner, (std::vector<int>{0, 2, 4}));
  ASSERT_EQ(usable.orb.corners.size(), 3U);
  EXPECT_EQ(usable.orb.corners[1].x, 50);
  EXPECT_EQ(usable.orb.descriptors[2][0], 4U);
  EXPECT_EQ(usable.motion,
            (std::vector<FeatureMotion>{FeatureMotion::still, FeatureMotion::on_mover, FeatureMotion::still}));
}

// A tracked frame whose features are those with these indices of the usable ones.
TrackedFrame tracked_with(const std::vector<int>& source) {
  TrackedFrame tracked;
  tracked.source = source;
  tracked.points.assign(source.size(), kNoPoint);
  tracked.outlier.assign(source.size(), 0);
  tracked.odometry.assign(source.size(), std::nullopt);
  return tracked;
}

void expect_report(const FeatureReport& report, FeatureState state, FeatureReason reason) {
  EXPECT_STREQ(name_of(report.state), name_of(state));
  EXPECT_STREQ(name_of(report.reason), name_of(reason));
}

TEST(ReportFeatures, EveryFeatureHasOneStateAndARejectedOneOneReason) {
  const Scene scene = scene_with({kNone, kMoved, kOnMover, kNone, kNone, kNone, kOnMover, kOnMover});
  const UsableFeatures usable = usable_features(scene);  // corners 0 2 3 4 5 6 7
  TrackedFrame tracked = tracked_with({0, 1, 2, 3, 4, 5, 6});
  tracked.points[0] = make_point_id(0, 7);                // corner 0 shows a map point
  tracked.outlier[2] = 1;                                 // corner 3 was matched, and does not fit
  tracked.odometry[3] = OdometryMatch{{0, 0, 2}, false};  // corner 4 shows a visual-odometry point
  tracked.points[5] = make_point_id(0, 8);                // corner 6: established, found where a mover is suspected
  tracked.outlier[6] = 1;                                 // corner 7: likewise, but does not fit
  const auto reports = report_features(scene, usable, tracked);
  ASSERT_EQ(reports.size(), 8U);
  expect_report(reports[0], FeatureState::used, FeatureReason::none);
  expect_report(reports[1], FeatureState::dynamic, FeatureReason::moved);
  expect_report(reports[2], FeatureState::dynamic, FeatureReason::on_mover);
  expect_report(reports[3], FeatureState::outlier, FeatureReason::disagrees);
  expect_report(reports[4], FeatureState::used, FeatureReason::none);
  expect_report(reports[5], FeatureState::unused, FeatureReason::none);
  expect_report(reports[6], FeatureState::used, FeatureReason::none);
  expect_report(reports[7], FeatureState::dynamic, FeatureReason::on_mover);
  for (size_t i = 0; i < reports.size(); ++i) {
    EXPECT_EQ(reports[i].image_x, 10 + 20 * static_cast<float>(i));
    EXPECT_EQ(reports[i].image_y, 100);
    const bool rejected = reports[i].state == FeatureState::dynamic || reports[i].state == FeatureState::outlier;
    EXPECT_EQ(rejected, reports[i].reason != FeatureReason::none);
  }
}

TEST(ReportFeatures, FeaturesThatTrackingLeftOutKeepWhatTheFilterSaid) {
  const Scene scene = scene_with({kNone, kOnMover, kNone});
  TrackedFrame tracked = tracked_with({2});  // the first two were dropped
  tracked.points[0] = make_point_id(0, 1);
  const auto reports = report_features(scene, usable_features(scene), tracked);
  expect_report(reports[0], FeatureState::unused, FeatureReason::none);
  expect_report(reports[1], FeatureState::dynamic, FeatureReason::on_mover);
  expect_report(reports[2], FeatureState::used, FeatureReason::none);
}

TEST(ReportFeatures, WhatMadeAMapPointWasUsed) {
  const Scene scene = scene_with({kNone, kNone});
  TrackedFrame tracked = tracked_with({});
  tracked.points.assign(2, kNoPoint);
  tracked.outlier.assign(2, 0);
  tracked.odometry.assign(2, std::nullopt);
  tracked.makes_point = {0, 1};
  const auto reports = report_features(scene, usable_features(scene), tracked);
  expect_report(reports[0], FeatureState::unused, FeatureReason::none);
  expect_report(reports[1], FeatureState::used, FeatureReason::none);
}

TEST(ReportFeatures, ALostFrameReportsWhatTheFilterSaw) {
  const Scene scene = scene_with({kNone, kOnMover});
  const auto reports = report_features(scene, usable_features(scene), TrackedFrame());
  expect_report(reports[0], FeatureState::unused, FeatureReason::none);
  expect_report(reports[1], FeatureState::dynamic, FeatureReason::on_mover);
}

}  // namespace
}  // namespace dkb
