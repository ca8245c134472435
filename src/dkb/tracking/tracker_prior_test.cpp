// SPDX-License-Identifier: Apache-2.0
// Where something beside the images says where the camera is.
#include "dkb/tracking/tracker_test_fixture.h"

namespace dkb {
namespace {

// The first `share` of every ten features where they would be, had they moved in the image.
void move(RgbdFeatures& features, const Eigen::Vector2f& moved, size_t share) {
  for (size_t f = 0; f < features.size(); ++f)
    if (f % 10 < share) features.keypoints[f].pixel += moved;
  features.grid = KeypointGrid(features.keypoints, features.grid);
}

class ExpectedCamera : public TrackerTest {
 protected:
  void SetUp() override {
    publish(start(on_path(0)));
    for (int i = 1; i < 4; ++i) ASSERT_EQ(see(i, 700, step_to(i)).state, TrackingState::tracking);
  }
  static MotionPrior step_to(double i) {
    MotionPrior step{on_path(i - 1) * on_path(i).inverse(), false, Matrix6d::Zero()};
    step.previous_from_current.translation += Eigen::Vector3d(0.03, 0, 0);
    step.covariance = axis_covariance(0.02, 0.01);
    return step;
  }
  // The next frame shows `shown` of the scene's points; something tells the step.
  TrackedFrame see(double i, size_t shown, const MotionPrior& step, const Eigen::Vector2f& moved = {0, 0},
                   const MotionPrior* prior = nullptr) {
    ++index;
    ViewOptions options;
    options.seed = static_cast<uint64_t>(index);
    options.pixel_noise = 0.3;
    view = scene.look(on_path(i), options);
    std::vector<int> some;
    for (size_t f = 0; f < view.shows.size() && some.size() < shown;
         f += view.shows.size() / std::min(shown, view.shows.size()))
      some.push_back(static_cast<int>(f));
    RgbdFeatures features = subset(*view.features, some);
    move(features, moved, 10);
    const FakeFeatures fake(std::make_shared<const RgbdFeatures>(std::move(features)));
    return tracker.track(
        {.index = index, .timestamp = index * kFrameTime, .features = fake, .prior = prior, .step = &step});
  }
};

TEST_F(ExpectedCamera, IsHeldByFewerPointsThanOneThatCouldBeAnywhere) {
  const TrackedFrame frame = see(4, 15, step_to(4));
  EXPECT_EQ(frame.state, TrackingState::tracking);
  EXPECT_GE(frame.inliers, 10);
  EXPECT_LT(frame.inliers, 20);
  // The step alone is 3 cm off.
  EXPECT_LT(distance_between(frame.cam_from_world, on_path(4)), 0.01);
}

TEST_F(ExpectedCamera, IsNotTakenAlongByPointsThatContradictIt) {
  const TrackedFrame frame = see(4, 15, step_to(4), {0, 40});
  EXPECT_EQ(frame.state, TrackingState::predicted);
  EXPECT_LT(distance_between(frame.cam_from_world, on_path(4)), 0.04);
}

TEST_F(ExpectedCamera, GoesOnWithoutTheImagesWhereTooFewPointsAreInView) {
  EXPECT_EQ(see(4, 7, step_to(4)).state, TrackingState::predicted);
}

// A step that something beside the camera tells weighs in a pose as one by the camera's own depth does.
TEST_F(ExpectedCamera, LeansOnWheelsByTheirCovariance) {
  MotionPrior wheels = step_to(4);  // 3 cm off
  const TrackedFrame frame = see(4, 30, wheels, {0, 0}, &wheels);
  ASSERT_TRUE(frame.by_observations);
  const double by_images = distance_between(frame.by_observations->cam_from_world, on_path(4));
  const double apart = distance_between(frame.by_observations->cam_from_world, frame.cam_from_world);
  EXPECT_LT(by_images, 0.01);
  EXPECT_GT(apart, 1e-5) << "toward the wheels";
  EXPECT_LT(apart, 0.005) << "but not to them: they claim 2 cm";
}

// A wheel that slips for a frame: the images contradict it by more than both can be off.
TEST_F(ExpectedCamera, LeavesWheelsOutThatTheImagesContradict) {
  MotionPrior wheels = step_to(4);  // 3 cm off
  wheels.covariance = axis_covariance(0.002, 0.001);
  const TrackedFrame told = see(4, 30, wheels, {0, 0}, &wheels);
  ASSERT_TRUE(told.by_observations);
  EXPECT_LT(distance_between(told.cam_from_world, told.by_observations->cam_from_world), 1e-9);
  EXPECT_LT(distance_between(told.cam_from_world, on_path(4)), 0.01);
}

TEST_F(ExpectedCamera, IsHeldByItsOwnDepthWhateverCornersSay) {
  MotionPrior by_depth = step_to(4);
  by_depth.covariance = axis_covariance(0.002, 0.001);
  EXPECT_TRUE(see(4, 30, by_depth).by_observations);
}

// The second frame of a map, of a camera that stands: nobody knows yet how fast it moves, and most of the corners are
// on somebody who gets up.
class FirstStep : public TrackerTest {
 protected:
  // [rad] that the camera is taken to have turned by.
  double turn_seen(const MotionPrior* step) {
    publish(start(on_path(0)));
    ++index;
    view = scene.look(on_path(0), {.pixel_noise = 0.3, .seed = 2});
    RgbdFeatures features = *view.features;
    move(features, {0, -20}, 7);
    const FakeFeatures fake(std::make_shared<const RgbdFeatures>(std::move(features)));
    const TrackedFrame frame =
        tracker.track({.index = index, .timestamp = index * kFrameTime, .features = fake, .step = step});
    EXPECT_EQ(frame.state, TrackingState::tracking);
    return vector_from_rotation(frame.cam_from_world.rotation).norm();
  }
};

TEST_F(FirstStep, FollowsMostCornersWhereNothingElseTells) {
  EXPECT_GT(turn_seen(nullptr), 0.03);
}

TEST_F(FirstStep, FollowsTheSurfacesWhereDepthSaysThatTheyStand) {
  const MotionPrior step{{}, false, axis_covariance(0.005, 0.004)};
  EXPECT_LT(turn_seen(&step), 0.005);
}

TEST_F(FirstStep, IsAsLongAsACameraUsuallyGoesWhereARotationAloneIsTold) {
  start(on_path(0));
  const MotionPrior turned{{}, true, axis_covariance(0, 0.001)};
  const std::optional<MotionPrior> step = tracker.expected_step(kFrameTime, &turned);
  ASSERT_TRUE(step);
  EXPECT_NEAR(std::sqrt(step->covariance(0, 0)), 0.2 / 30, 0.0005);
  EXPECT_NEAR(std::sqrt(step->covariance(5, 5)), 0.001, 1e-9);
}

// A room, and somebody near the camera whom the map holds as still.
class WhoWalksOff : public ::testing::Test {
 protected:
  // Three frames of him where he stands.
  void begin(size_t points_of_body) {
    of_body = points_of_body;
    Random random(3);
    for (size_t p = 0; p < of_body; ++p)
      scene.points[p] = {random.uniform(-0.15, 0.1), random.uniform(-0.2, 0.2), random.uniform(0.45, 0.55)};
    for (int i = 0; i < 3; ++i) {
      const TrackedFrame frame = see({});
      EXPECT_EQ(frame.state, TrackingState::tracking);
      if (i == 0) tracker.make_keyframe(0, frame);
    }
  }
  void move_body(const Rigid3& moved) {
    for (size_t p = 0; p < of_body; ++p) scene.points[p] = moved * scene.points[p];
  }
  TrackedFrame see(const Rigid3& cam_from_world, const MotionPrior* step = nullptr) {
    ++index;
    const View view = scene.look(cam_from_world,
                                 {.pixel_noise = 0.4, .depth_noise = 0.002, .seed = 1 + static_cast<uint64_t>(index)});
    const FakeFeatures features(view.features);
    return tracker.track(
        {.index = index, .timestamp = index * kFrameTime, .features = features, .step = step, .movers = true});
  }

  // [m] in each of five frames.
  void expect_camera_stays_while_he_goes(double step_of_body, const MotionPrior* step = nullptr) {
    for (int i = 0; i < 5; ++i) {
      move_body(Rigid3(Eigen::Quaterniond::Identity(), {step_of_body, 0, 0}));
      const TrackedFrame frame = see({}, step);
      ASSERT_EQ(frame.state, TrackingState::tracking) << i;
      EXPECT_LT(distance_between(frame.cam_from_world, {}), 0.015) << i;
    }
  }

  size_t of_body = 0;
  TestScene scene{1500, 1, 0.7, 2.5};
  Tracker tracker{scene.optics(), {}, 1};
  FrameIndex index = -1;
};

TEST_F(WhoWalksOff, DoesNotTakeTheCameraAlongByALittleInEachFrame) {
  begin(90);
  const MotionPrior still{{}, false, axis_covariance(0.002, 0.004)};
  expect_camera_stays_while_he_goes(0.01, &still);
}

// His corners are most of what is found, so that the pose goes with him; where the velocity puts the camera, the room
// is.
TEST_F(WhoWalksOff, DoesNotTakeTheCameraAlongAtOnce) {
  begin(600);
  expect_camera_stays_while_he_goes(0.045);
  for (const PointVisibility& p : tracker.make_report().visibility)
    EXPECT_LE(p.visible, index) << "searches of one frame count once";
}

// As where he is too near for the sensor and hides most of what has depth.
TEST_F(WhoWalksOff, DoesNotTakeTheCameraAlongWhereNothingElseTells) {
  begin(90);
  expect_camera_stays_while_he_goes(0.01);
}

}  // namespace
}  // namespace dkb
