// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/timing_calibration.h"

#include <gtest/gtest.h>

#include <utility>

#include "dkb/matching/test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

Vector6d velocity_at(int n) {
  Vector6d velocity;
  velocity << 0.3 * std::sin(0.3 * n), 0.1, 0.2 * std::cos(0.2 * n), 0.2 * std::sin(0.5 * n), 0.7 * std::cos(0.4 * n),
      0.1;
  return velocity;
}

// Frames of a scene under motion that changes, with rows exposed late by `readout`, of which what is known was taken
// out. `outlines`: every second corner lies beside a depth step and slides with the camera, the lower in the image the
// more.
double calibrated(double readout, bool estimate = true, double file = 0, int frames = 60, bool outlines = false,
                  double fps = 30) {
  const TestScene scene(500);
  Optics optics = scene.optics();
  optics.camera.readout = file;
  optics.camera.fps = fps;
  TimingCalibration calibration(optics, estimate, false);
  for (int n = 0; n < frames; ++n) {
    const Vector6d velocity = velocity_at(n);
    TrackedFrame frame;
    std::vector<std::optional<Eigen::Vector3d>> positions;
    frame.cam_from_world = TestScene::camera_at({0.01 * n, 0, 0}, {0, 0.005 * n, 0});
    const View view = scene.look(frame.cam_from_world, {.pixel_noise = 0.5, .seed = static_cast<uint64_t>(n) + 1});
    RgbdFeatures features = *view.features;
    for (size_t f = 0; f < features.size(); ++f) {
      Keypoint& k = features.keypoints[f];
      const Eigen::Vector3d p = frame.cam_from_world * scene.points[static_cast<size_t>(view.shows[f])];
      const double row = k.image_pixel.y() / optics.camera.height - 0.5;
      double late = (readout - calibration.camera().readout) * row;
      if (outlines && f % 2 == 0) {
        k.lent_depth = std::exchange(k.depth, 0.0f);
        late += 0.01 * row;
      }
      const Eigen::Vector3d then = p + late * (velocity.head<3>() + velocity.tail<3>().cross(p));
      k.pixel += (optics.camera.project(then) - optics.camera.project(p)).cast<float>();
      frame.points.push_back(static_cast<PointId>(view.shows[f]));
      positions.emplace_back(scene.points[static_cast<size_t>(view.shows[f])]);
    }
    frame.features = std::make_shared<const RgbdFeatures>(std::move(features));
    calibration.add(frame, {}, velocity, positions);
  }
  return calibration.camera().readout;
}

TEST(TimingCalibration, FindsTheReadoutWithinAMillisecond) {
  for (const double readout : {-0.025, -0.012, 0.0, 0.012, 0.025}) EXPECT_NEAR(calibrated(readout), readout, 1e-3);
}

TEST(TimingCalibration, KnowsMostOfItAfterHalfASecond) {
  EXPECT_NEAR(calibrated(0.02, true, 0, 15), 0.02, 3e-3);
}

TEST(TimingCalibration, CornersThatSlideAlongOutlinesTellNothing) {
  EXPECT_NEAR(calibrated(0.012, true, 0, 60, true), 0.012, 1e-3);
}

TEST(TimingCalibration, BeforeAnythingIsSeenTheFirstRowIsReadFirstAndAllTimesAreAsLikely) {
  EXPECT_DOUBLE_EQ(calibrated(0.02, true, 0, 0), 0.0165);
}

TEST(TimingCalibration, ACameraThatTellsItsReadoutIsBelieved) {
  EXPECT_EQ(calibrated(0.02, true, 0.01), 0.01);
  EXPECT_EQ(calibrated(0.02, true, -0.01), -0.01);
}

TEST(TimingCalibration, StaysOutWhenItIsNotWanted) {
  EXPECT_EQ(calibrated(0.02, false), 0.0);
}

TEST(TimingCalibration, NeverLeavesWhatIsBelievable) {
  EXPECT_EQ(calibrated(0.06), 0.033);
  EXPECT_EQ(calibrated(-0.06), -0.033);
}

TEST(TimingCalibration, NoSensorIsReadLongerThanAFrame) {
  EXPECT_DOUBLE_EQ(calibrated(0.02, true, 0, 60, false, 60), 1.0 / 60);
  EXPECT_DOUBLE_EQ(calibrated(0, true, 0, 0, false, 90), 0.5 / 90);
  EXPECT_DOUBLE_EQ(calibrated(0, true, 0, 0, false, 10), 0.0165);
}

// A slanted wall before a camera whose depth images show it `offset` [s] after their stamps.
struct LateWall {
  Eigen::Vector3d normal = Eigen::Vector3d(0.4, 0.2, -1).normalized();  // the wall: normal . p = -2 m

  // [m] of it along the ray of a pixel, from a camera.
  double depth_at(const Eigen::Vector3d& ray, const Rigid3& cam_from_world) const {
    const Rigid3 world_from_cam = cam_from_world.inverse();
    return (-2 - normal.dot(world_from_cam.translation)) / normal.dot(world_from_cam.rotation * ray);
  }

  struct Options {
    double file = 0;  // [s] what the camera's file says
    bool learn = true;
    int frames = 60;
    double hole = 0;  // share of depths without neighbours
  };
  // [s] what is learnt.
  double learnt(double offset, const Options& options) const {
    Optics optics = TestScene(1).optics();
    CameraModel& camera = optics.camera;
    camera.fps = 30;
    camera.depth_time_offset = options.file;
    TimingCalibration calibration(optics, false, options.learn);
    Random random(1);
    for (int n = 0; n < options.frames; ++n) {
      const Vector6d velocity = velocity_at(n);
      TrackedFrame frame;
      frame.cam_from_world = TestScene::camera_at({0.01 * n, 0, 0}, {0, 0.005 * n, 0});
      // Where the camera was when the depth image was taken, which is held for what it showed at its stamp.
      const double late = offset - calibration.camera().depth_time_offset;
      const Rigid3 depth_cam_from_world = rigid3_from_tangent(late * velocity) * frame.cam_from_world;
      DepthImage depth(camera.width, camera.height);
      const auto measured = [&](const Eigen::Vector2d& pixel) {
        const double z = depth_at(camera.unproject(pixel, 1), depth_cam_from_world);
        return static_cast<float>(z + optics.noise.flat_depth_sigma(z) * random.normal());
      };
      RgbdFeatures features;
      std::vector<std::optional<Eigen::Vector3d>> positions;
      for (int y = 30; y < camera.height; y += 30)
        for (int x = 30; x < camera.width; x += 30) {
          const Eigen::Vector3d ray = camera.unproject(Eigen::Vector2d(x, y), 1);
          positions.emplace_back(frame.cam_from_world.inverse() * (ray * depth_at(ray, frame.cam_from_world)));
          Keypoint k;
          k.pixel = k.image_pixel = Eigen::Vector2f(static_cast<float>(x + 0.5 * random.normal()),
                                                    static_cast<float>(y + 0.5 * random.normal()));
          k.depth = measured(k.pixel.cast<double>());
          for (int v = y - 8; v <= y + 8; ++v)
            for (int u = x - 8; u <= x + 8; ++u)
              depth(u, v) = random.uniform() < options.hole ? 0.0f : measured(Eigen::Vector2d(u, v));
          features.keypoints.push_back(k);
          frame.points.push_back(static_cast<PointId>(frame.points.size()));
        }
      frame.features = std::make_shared<const RgbdFeatures>(std::move(features));
      calibration.add(frame, depth, velocity, positions);
    }
    return calibration.camera().depth_time_offset;
  }
};

TEST(TimingCalibration, FindsTheTimeOfDepthImagesWithinThreeMilliseconds) {
  for (const double offset : {0.0, -0.018, 0.025}) EXPECT_NEAR(LateWall().learnt(offset, {}), offset, 3e-3);
}

TEST(TimingCalibration, BeforeAnythingIsSeenDepthIsAsStamped) {
  EXPECT_EQ(LateWall().learnt(-0.018, {.frames = 0}), 0.0);
}

TEST(TimingCalibration, ACameraThatTellsTheTimeOfItsDepthIsBelieved) {
  EXPECT_EQ(LateWall().learnt(-0.018, {.file = -0.005, .frames = 5}), -0.005);
}

TEST(TimingCalibration, LeavesDepthAsStampedWhenItIsNotWanted) {
  EXPECT_EQ(LateWall().learnt(-0.018, {.learn = false, .frames = 5}), 0.0);
}

TEST(TimingCalibration, DepthWithoutASurfaceAroundTellsNothingOfItsTime) {
  EXPECT_EQ(LateWall().learnt(-0.018, {.frames = 5, .hole = 1}), 0.0);
}

TEST(TimingCalibration, ADepthImageIsOfItsOwnFrame) {
  EXPECT_EQ(LateWall().learnt(-0.08, {.frames = 30}), -0.033);
}

}  // namespace
}  // namespace dkb
