// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/tracking_map.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace dkb {
namespace {

Rigid3 shifted(double x) {
  return {Eigen::Quaterniond::Identity(), {x, 0, 0}};
}

// Keyframe 0 at x = 1 m, and keyframe 1 as the root of another map.
MapView two_roots() {
  Map map;
  for (KeyframeId id = 0; id < 2; ++id) {
    Keyframe k;
    k.id = id;
    k.features = std::make_shared<const RgbdFeatures>();
    k.parent = kNoKeyframe;
    k.cam_from_world = shifted(1 + id);
    map.add_keyframe(k);
  }
  return map.snapshot();
}

TEST(TrackingMap, AKeyframeThatWasNeverMadeHasNoPose) {
  TrackingMap map;
  EXPECT_THROW(map.cam_from_world(0), std::logic_error);
  EXPECT_THROW(map.root(0), std::logic_error);
  map.take_view(two_roots());
  EXPECT_NO_THROW(map.cam_from_world(0));
  EXPECT_THROW(map.cam_from_world(2), std::logic_error);
  EXPECT_THROW(map.cam_from_world(kNoKeyframe), std::logic_error);
  EXPECT_THROW(map.root(2), std::logic_error);
}

TEST(TrackingMap, PendingKeyframesHangOnTheirReferences) {
  TrackingMap map;
  map.take_view(two_roots());
  map.add_pending(2, 0, shifted(10), Matrix6d::Zero());
  map.add_pending(3, 2, shifted(100), Matrix6d::Zero());
  map.add_pending(4, kNoKeyframe, shifted(7), Matrix6d::Zero());
  EXPECT_NEAR(map.cam_from_world(2).translation.x(), 11, 1e-12);
  EXPECT_NEAR(map.cam_from_world(3).translation.x(), 111, 1e-12);
  EXPECT_NEAR(map.cam_from_world(4).translation.x(), 7, 1e-12);
  EXPECT_EQ(map.root(3), 0);
  EXPECT_EQ(map.root(1), 1);
  EXPECT_EQ(map.root(4), 4);
}

TEST(TrackingMap, APublishedKeyframeIsPendingNoMore) {
  TrackingMap map;
  map.add_pending(0, kNoKeyframe, shifted(5), Matrix6d::Zero());
  EXPECT_NEAR(map.cam_from_world(0).translation.x(), 5, 1e-12);
  map.take_view(two_roots());
  EXPECT_NEAR(map.cam_from_world(0).translation.x(), 1, 1e-12) << "the map's word counts";
}

TEST(TrackingMap, ACopyKeepsWhatItKnew) {
  TrackingMap map;
  map.add_pending(0, kNoKeyframe, shifted(5), Matrix6d::Zero());
  const TrackingMap copy = map;
  map.take_view(two_roots());
  EXPECT_NEAR(copy.cam_from_world(0).translation.x(), 5, 1e-12);
  EXPECT_THROW(copy.cam_from_world(1), std::logic_error);
}

TEST(TrackingMap, CovariancesAreOfTheWorldAndPendingKeyframesHaveTheirReferences) {
  Map made = *two_roots();
  Matrix6d covariance = Matrix6d::Zero();
  covariance(5, 5) = 4e-6;  // 2 mrad about the optical axis of a camera at x = -1 m
  made.set_covariance(0, covariance);
  TrackingMap map;
  map.take_view(made.snapshot());
  map.add_pending(2, 0, shifted(10), Matrix6d::Zero());
  const Matrix6d world = map.covariance(0);
  EXPECT_NEAR(world(5, 5), 4e-6, 1e-12);
  EXPECT_NEAR(world(1, 1), 4e-6, 1e-12) << "the lever of one metre";
  EXPECT_NEAR(world(0, 0), 0, 1e-12);
  EXPECT_TRUE(map.covariance(2).isApprox(world));
  EXPECT_TRUE(map.covariance(1).isZero());
}

TEST(TrackingMap, AMapThatGoesOnUnseenIsAsUncertainAsTheWayThere) {
  Map made = *two_roots();
  made.set_covariance(0, 1e-6 * Matrix6d::Identity());
  TrackingMap map;
  map.take_view(made.snapshot());
  Matrix6d way = Matrix6d::Zero();  // 10 cm along the optical axis
  way(2, 2) = 0.01;
  map.add_pending(2, 0, shifted(10), way);
  map.add_pending(3, 2, shifted(1), Matrix6d::Zero());
  const Matrix6d expected = map.covariance(0) + way;  // the cameras are not turned
  EXPECT_TRUE(map.covariance(2).isApprox(expected));
  EXPECT_TRUE(map.covariance(3).isApprox(expected)) << "what hangs on it shares its uncertainty";
  map.add_pending(4, kNoKeyframe, shifted(7), Matrix6d::Zero());
  map.add_pending(5, 4, shifted(1), way);
  EXPECT_TRUE(map.covariance(4).isZero());
  EXPECT_TRUE(map.covariance(5).isApprox(way)) << "of a map that mapping has not answered for at all";
}

}  // namespace
}  // namespace dkb
