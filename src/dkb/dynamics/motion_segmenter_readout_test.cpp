// SPDX-License-Identifier: Apache-2.0
// Depth images whose rows are read one after the other, or that are older than their stamps.
#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/dynamics/motion_segmenter.h"
#include "dkb/features/plane_test_scene.h"
#include "dkb/geometry/motion_model.h"

namespace dkb {
namespace {

// What the camera sees of its corner of a room, with boards standing in it.
DepthImage view_with_boards(const TurningCamera& turning, double t, uint64_t seed) {
  DepthImage depth = turning.view(t, seed);
  const CameraModel camera = plane_test_camera();
  for (int y = 0; y < depth.height(); ++y) {
    const Rigid3 world_from_cam = turning.cam_from_world(turning.time_of_row(t, y)).inverse();
    for (int x = 0; x < depth.width(); ++x) {
      const Eigen::Vector3d ray = world_from_cam.rotation * camera.unproject(Eigen::Vector2d(x, y), 1.0);
      for (int board = 0; board < 8; ++board) {
        const double left = -0.7 + 0.35 * (board % 4), top = board < 4 ? -0.45 : 0.05;
        const double away = 0.8 + 0.05 * (board % 3);
        const double z = (away - world_from_cam.translation.z()) / ray.z();  // along the optical axis
        const Eigen::Vector3d at = world_from_cam.translation + z * ray;
        if (z > 0.1 && z < depth(x, y) && at.x() > left && at.x() < left + 0.2 && at.y() > top && at.y() < top + 0.3)
          depth(x, y) = static_cast<float>(z);
      }
    }
  }
  return depth;
}

// The share of cells that move after three seconds, though nothing does. `gap` [s] between the stamps
// of depth and colour, `age` [s] of the depth image at its stamp.
double moving_share(const CameraModel& camera, const TurningCamera& turning, double gap = 0, double age = 0) {
  MotionSegmenter segmenter(camera, SensorNoise());
  double share = 0;
  int frames = 0;
  for (int n = 0; n < 150; ++n) {
    const double t = n * TurningCamera::kInterval;
    RgbdImage image;
    image.timestamp = t;
    image.depth_timestamp = t + gap;
    image.depth = view_with_boards(turning, t + gap - age, 100 + static_cast<uint64_t>(n));
    segmenter.observe(image, image.depth_time(camera), turning.cam_from_world(t), axis_covariance(0.01, 0.03));
    const MoverMask mask = segmenter.mask();
    if (n >= 90) {
      const auto moving = std::count(mask.cells.data(), mask.cells.data() + mask.cells.size(), uint8_t{255});
      share += static_cast<double>(moving) / static_cast<double>(mask.cells.size());
      ++frames;
    }
    segmenter.commit(turning.cam_from_world(t));
  }
  return share / frames;
}

// In a fast turn outlines are sheared, in each view otherwise: held against each other as if they had been read at
// once, things that stand are found in space that was seen empty.
TEST(MotionSegmenter, RowsThatAreReadLateAreNoMovers) {
  for (const double readout : {0.0, 0.03})
    EXPECT_LT(moving_share(plane_test_camera(), {readout}), 0.002) << readout;  // 0.02 without
}

// In a turn, an image of 18 ms before, as those of TUM's Kinect are, shows edges elsewhere than the pose of its stamp
// does.
TEST(MotionSegmenter, DepthThatIsOlderThanItsStampIsNoMover) {
  constexpr double kAge = 0.018;
  CameraModel camera = plane_test_camera();
  camera.depth_time_offset = -kAge;
  for (const double gap : {0.0, -0.015})
    EXPECT_LT(moving_share(camera, {0.0}, gap, kAge), 0.002) << gap;  // 0.18 without the offset
}

// Nothing tells how the camera turned when the first image was taken, but the second one does.
TEST(MotionSegmenter, TheFirstStepIsRightThoughDepthIsOlderThanColour) {
  constexpr double kAge = 0.03;
  const TurningCamera turning{0.0};
  CameraModel camera = plane_test_camera();
  camera.depth_time_offset = -kAge;
  for (const double start : {0.1, 0.5, 0.9, 1.3}) {
    MotionSegmenter segmenter(camera, SensorNoise());
    const double times[] = {start, start + TurningCamera::kInterval};
    for (const double t : times) {
      RgbdImage image;
      image.timestamp = image.depth_timestamp = t;
      image.depth = view_with_boards(turning, t - kAge, 7);
      segmenter.observe(image, image.depth_time(camera), turning.cam_from_world(start), axis_covariance(0.1, 0.3));
      if (t == start) segmenter.commit(turning.cam_from_world(t));
    }
    ASSERT_TRUE(segmenter.aligned_step());
    const Rigid3 step = turning.cam_from_world(times[1]) * turning.cam_from_world(start).inverse();
    const Rigid3 off = step * segmenter.aligned_step()->previous_from_current;
    EXPECT_LT(tangent_from_rigid3(off).tail<3>().norm(), 0.35 * tangent_from_rigid3(step).tail<3>().norm())
        << start;  // 0.9 of it were the first depth where the colour is
  }
}

}  // namespace
}  // namespace dkb
