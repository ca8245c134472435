// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/readout_calibration.h"

#include <gtest/gtest.h>

#include <utility>

#include "dkb/matching/test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Frames of a scene under motion that changes, with rows exposed late by `readout`, of which what is known was taken
// out. `outlines`: every second corner lies beside a depth step and slides with the camera, the lower in the image the
// more.
double calibrated(double readout, bool estimate = true, double file = 0, int frames = 60, bool outlines = false,
                  double fps = 30) {
  const TestScene scene(500);
  Optics optics = scene.optics();
  optics.camera.readout = file;
  optics.camera.fps = fps;
  ReadoutCalibration calibration(optics, estimate);
  for (int n = 0; n < frames; ++n) {
    Vector6d velocity;
    velocity << 0.3 * std::sin(0.3 * n), 0.1, 0.2 * std::cos(0.2 * n), 0.2 * std::sin(0.5 * n), 0.7 * std::cos(0.4 * n),
        0.1;
    TrackedFrame frame;
    std::vector<std::optional<Eigen::Vector3d>> positions;
    frame.cam_from_world = TestScene::camera_at({0.01 * n, 0, 0}, {0, 0.005 * n, 0});
    const View view = scene.look(frame.cam_from_world, {.pixel_noise = 0.5, .seed = static_cast<uint64_t>(n) + 1});
    RgbdFeatures features = *view.features;
    for (size_t f = 0; f < features.size(); ++f) {
      Keypoint& k = features.keypoints[f];
      const Eigen::Vector3d p = frame.cam_from_world * scene.points[static_cast<size_t>(view.shows[f])];
      const double row = k.image_pixel.y() / optics.camera.height - 0.5;
      double late = (readout - calibration.readout()) * row;
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
    calibration.add(frame, velocity, positions);
  }
  return calibration.readout();
}

TEST(ReadoutCalibration, FindsTheReadoutWithinAMillisecond) {
  for (const double readout : {0.0, 0.012, 0.025}) EXPECT_NEAR(calibrated(readout), readout, 1e-3);
}

TEST(ReadoutCalibration, KnowsMostOfItAfterHalfASecond) {
  EXPECT_NEAR(calibrated(0.02, true, 0, 15), 0.02, 3e-3);
}

TEST(ReadoutCalibration, CornersThatSlideAlongOutlinesTellNothing) {
  EXPECT_NEAR(calibrated(0.012, true, 0, 60, true), 0.012, 1e-3);
}

TEST(ReadoutCalibration, BeforeAnythingIsSeenAllReadoutsAreAsLikely) {
  EXPECT_DOUBLE_EQ(calibrated(0.02, true, 0, 0), 0.0165);
}

TEST(ReadoutCalibration, ACameraThatTellsItsReadoutIsBelieved) {
  EXPECT_EQ(calibrated(0.02, true, 0.01), 0.01);
}

TEST(ReadoutCalibration, StaysOutWhenItIsNotWanted) {
  EXPECT_EQ(calibrated(0.02, false), 0.0);
}

TEST(ReadoutCalibration, NeverLeavesWhatIsBelievable) {
  EXPECT_EQ(calibrated(0.06), 0.033);
  EXPECT_EQ(calibrated(-0.01), 0.0);
}

TEST(ReadoutCalibration, NoSensorIsReadLongerThanAFrame) {
  EXPECT_DOUBLE_EQ(calibrated(0.02, true, 0, 60, false, 60), 1.0 / 60);
  EXPECT_DOUBLE_EQ(calibrated(0, true, 0, 0, false, 90), 0.5 / 90);
  EXPECT_DOUBLE_EQ(calibrated(0, true, 0, 0, false, 10), 0.0165);
}

}  // namespace
}  // namespace dkb
