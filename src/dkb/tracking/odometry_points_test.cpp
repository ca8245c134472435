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
  OdometryPoints points({camera, {}}, 4.0);
  TrackedFrame frame = frame_of({{100, 80, 2}});
  frame.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 1});
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 1u);
  EXPECT_FALSE(points.match(0, frame).guessed);
  EXPECT_LT((camera.project(frame.cam_from_world * candidates[0].position) - Eigen::Vector2d(100, 80)).norm(), 1e-9);
  EXPECT_NEAR(candidates[0].position.z(), 1.0, 1e-12);
}

TEST(OdometryPoints, WithoutDepthTheyTakeTheHarmonicMeanAround) {
  OdometryPoints points({}, 4.0);
  const TrackedFrame frame = frame_of({{100, 80, 0}, {110, 80, 1}, {100, 90, 3}, {300, 80, 2}, {500, 400, 0}});
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 5u);
  EXPECT_TRUE(points.match(0, frame).guessed);
  EXPECT_NEAR(candidates[0].position.z(), 1.5, 1e-6);  // 2 / (1/1 + 1/3)
  EXPECT_TRUE(points.match(4, frame).guessed);
  EXPECT_NEAR(candidates[4].position.z(), 4.0, 1e-6);  // no depth is near
}

TEST(OdometryPoints, AtTheReachOfDepthNothingIsTooFar) {
  OdometryPoints points({}, 5.3);  // as a float it is a little more
  const TrackedFrame frame = frame_of({{100, 80, 0}});
  points.remember(frame);
  EXPECT_EQ(points.candidates(frame).size(), 1u);
}

TEST(OdometryPoints, ASurfaceBesideLendsItsDepthBeforeTheSurroundingsDo) {
  OdometryPoints points({}, 4.0);
  TrackedFrame frame = frame_of({{100, 80, 0}, {110, 80, 3}});
  RgbdFeatures lent = *frame.features;
  lent.keypoints[0].lent_depth = 2;
  frame.features = std::make_shared<const RgbdFeatures>(std::move(lent));
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 2u);
  EXPECT_TRUE(points.match(0, frame).guessed);
  EXPECT_NEAR(candidates[0].position.z(), 2, 1e-6);
}

TEST(OdometryPoints, AGuessedDepthIsWorthTheLessTheFartherTheCameraWent) {
  CameraModel camera;
  camera.fx = 500;
  OdometryPoints points({camera, {}}, 4.0);
  const Rigid3 last(Eigen::Quaterniond::Identity(), {0, 0, 1});  // the world's origin lies 1 m before it
  const Rigid3 now(rotation_from_vector({0, 0.1, 0}) * last.rotation,
                   rotation_from_vector({0, 0.1, 0}) * Eigen::Vector3d(0.03, 0.04, 1));
  const OdometryMatch guessed{{0.2, 0, 1}, true};
  EXPECT_NEAR(points.parallax_sigma(guessed, last, now), 500 * 0.05 / (std::sqrt(3.0) * 2), 1e-9);
  EXPECT_EQ(points.parallax_sigma(guessed, last, last), 0);
}

TEST(OdometryPoints, LeaveOutMapPointsOutliersSuspectsAndTheFar) {
  OdometryPoints points({}, 4.0);
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
  OdometryPoints points({}, 4.0);
  TrackedFrame frame = frame_of({{100, 80, 2}, {300, 80, 2}, {310, 80, 0}});
  frame.odometry[0] = OdometryMatch{{0.1, 0.2, 1.9}, false};
  frame.odometry[2] = OdometryMatch{{0.1, 0.2, 1.5}, true};
  points.remember(frame);
  const auto candidates = points.candidates(frame);
  ASSERT_EQ(candidates.size(), 3u);
  EXPECT_LT((candidates[0].position - Eigen::Vector3d(0.1, 0.2, 1.9)).norm(), 1e-12);
  EXPECT_NEAR(candidates[2].position.z(), 2.0, 1e-6);
  EXPECT_TRUE(points.match(2, frame).guessed);
}

// A point without depth at 100 px right of and 80 px below the corner of the image, seen first at the world's origin.
struct SeenWithoutDepth : testing::Test {
  const CameraModel camera;
  OdometryPoints points{{camera, {}}, 4.0};
  TrackedFrame frame = frame_of({{100, 80, 0}, {110, 80, 2}});

  SeenWithoutDepth() { frame.covariance.setZero(); }
  OdometryMatch first() {
    points.remember(frame);
    return points.match(0, frame);
  }
  bool moved(const OdometryMatch& match, const Eigen::Vector2d& pixel, const Rigid3& cam_from_world,
             const Matrix6d& covariance = Matrix6d::Zero()) const {
    return points.has_moved(match, keypoint_at(pixel), cam_from_world, covariance, 5.991);
  }
  static Keypoint keypoint_at(const Eigen::Vector2d& pixel) {
    Keypoint k;
    k.pixel = pixel.cast<float>();
    return k;
  }
};

TEST_F(SeenWithoutDepth, HasNotMovedWhereAnyDepthOnItsRayIsSeen) {
  const OdometryMatch match = first();
  const Rigid3 cam_from_world(Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Eigen::Vector3d::UnitY())), {0.2, -0.1, 0.3});
  for (const double depth : {0.31, 0.7, 2.0, 9.0, 1e4}) {
    const Eigen::Vector3d point = camera.unproject({100, 80}, depth);
    EXPECT_FALSE(moved(match, camera.project(cam_from_world * point), cam_from_world)) << depth;
  }
}

TEST_F(SeenWithoutDepth, HasMovedBesideItsRayAndBeyondItsEnds) {
  const OdometryMatch match = first();
  // Both sightings are off by 1 px: 95 % lie within sqrt(2 * 5.991) = 3.46 px.
  EXPECT_FALSE(moved(match, {103.4, 80}, {}));
  EXPECT_TRUE(moved(match, {103.5, 80}, {}));
  const Rigid3 beside(Eigen::Quaterniond::Identity(), {-0.1, 0, 0});  // the camera went to the right: points go left
  const double nearest = camera.fx * 0.1 / 0.3;                       // [px] that a point 0.3 m away goes
  EXPECT_FALSE(moved(match, {100 - nearest - 3.4, 80}, beside));
  EXPECT_TRUE(moved(match, {100 - nearest - 3.5, 80}, beside));
  EXPECT_FALSE(moved(match, {103.4, 80}, beside));  // infinitely far
  EXPECT_TRUE(moved(match, {103.5, 80}, beside));
  EXPECT_TRUE(moved(match, {90, 83.5}, beside));
}

TEST_F(SeenWithoutDepth, HasNotMovedWhereThePoseMayBeOffByAsMuch) {
  const OdometryMatch match = first();
  Matrix6d covariance = Matrix6d::Zero();
  // 2 px along x, by a turn about y. At x, a turn moves the image by fx (1 + x^2).
  const double x = match.first.direction.x(), sd = 2 / (camera.fx * (1 + x * x));
  covariance(4, 4) = sd * sd;
  const double y = match.first.direction.y(), across = sd * camera.fy * x * y;
  const double limit = std::sqrt(5.991 * (1 + 1 + (4 + across * across) / 2));
  EXPECT_FALSE(moved(match, {100 + limit - 0.01, 80}, {}, covariance));
  EXPECT_TRUE(moved(match, {100 + limit + 0.01, 80}, {}, covariance));
}

TEST_F(SeenWithoutDepth, IsFollowedOnWhenItMovesAndKeepsItsFirstRay) {
  const OdometryMatch match = first();
  TrackedFrame next = frame_of({{104, 80, 0}, {110, 80, 2}});
  next.cam_from_world = Rigid3(Eigen::Quaterniond::Identity(), {0, 0, 0.2});
  next.odometry[0] = points.match(0, frame);
  next.odometry[0]->moves = true;
  next.outlier[0] = 1;
  points.remember(next);
  const OdometryMatch then = points.match(0, next);
  EXPECT_TRUE(then.moves);
  EXPECT_LT((then.first.origin - match.first.origin).norm() + (then.first.direction - match.first.direction).norm(),
            1e-12);
}

}  // namespace
}  // namespace dkb
