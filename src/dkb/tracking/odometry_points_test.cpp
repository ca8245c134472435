// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/odometry_points.h"

#include <gtest/gtest.h>

#include "dkb/matching/test_scene.h"

namespace dkb {
namespace {

// A frame at the world's origin with features at the given pixels and depths (0 = none), all of the finest level.
TrackedFrame frame_of(const std::vector<Eigen::Vector3f>& pixels_and_depths) {
  auto features = std::make_shared<RgbdFeatures>();
  for (const Eigen::Vector3f& p : pixels_and_depths) {
    Keypoint k;
    k.pixel = k.image_pixel = p.head<2>();
    k.depth = p.z();
    features->keypoints.push_back(k);
    features->descriptors.push_back({});
  }
  const CameraModel camera;
  features->grid = KeypointGrid(features->keypoints, camera.width, camera.height);
  TrackedFrame frame;
  frame.features = features;
  frame.points.assign(features->size(), kNoPoint);
  frame.outlier.assign(features->size(), 0);
  frame.odometry.assign(features->size(), std::nullopt);
  return frame;
}

TEST(OdometryPoints, StartAtTheirDepth) {
  const CameraModel camera;
  OdometryPoints points(camera, 1.2, 4.0);
  TrackedFrame frame = frame_of({{100, 80, 2}});
  frame.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1});
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 1u);
  EXPECT_FALSE(points.guessed(0));
  EXPECT_LT((camera.project(frame.cam_from_world * candidates[0].position) - Eigen::Vector2d(100, 80)).norm(), 1e-9);
  EXPECT_NEAR(candidates[0].position.z(), 1.0, 1e-12);
}

TEST(OdometryPoints, WithoutDepthTheyTakeTheHarmonicMeanAround) {
  OdometryPoints points(CameraModel(), 1.2, 4.0);
  const TrackedFrame frame = frame_of({{100, 80, 0}, {110, 80, 1}, {100, 90, 3}, {300, 80, 2}, {500, 400, 0}});
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 4u);  // nothing is near the last
  EXPECT_TRUE(points.guessed(0));
  EXPECT_NEAR(candidates[0].position.z(), 1.5, 1e-6);  // 2 / (1/1 + 1/3)
}

TEST(OdometryPoints, LeaveOutMapPointsOutliersSuspectsAndTheFar) {
  OdometryPoints points(CameraModel(), 1.2, 4.0);
  TrackedFrame frame = frame_of({{100, 80, 1}, {200, 80, 1}, {300, 80, 1}, {400, 80, 5}, {500, 80, 1}});
  frame.points[0] = make_point_id(0, 0);
  frame.outlier[1] = 1;
  frame.motion.assign(5, FeatureMotion::still);
  frame.motion[2] = FeatureMotion::on_mover;
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 1u);
  frame.points[4] = make_point_id(0, 4);
  points.drop_mapped(frame);
  EXPECT_TRUE(points.candidates(frame).empty());
}

TEST(OdometryPoints, KeepTheirPlaceInTheWorldWhileFollowedButForGuessedOnes) {
  OdometryPoints points(CameraModel(), 1.2, 4.0);
  TrackedFrame frame = frame_of({{100, 80, 2}, {300, 80, 2}, {310, 80, 0}});
  frame.odometry[0] = OdometryMatch{{0.1, 0.2, 1.9}, false};
  frame.odometry[2] = OdometryMatch{{0.1, 0.2, 1.5}, true};
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 3u);
  EXPECT_LT((candidates[0].position - Eigen::Vector3d(0.1, 0.2, 1.9)).norm(), 1e-12);
  EXPECT_NEAR(candidates[2].position.z(), 2.0, 1e-6);
  EXPECT_TRUE(points.guessed(2));
}

}  // namespace
}  // namespace dkb
