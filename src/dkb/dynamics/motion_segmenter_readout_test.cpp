// SPDX-License-Identifier: Apache-2.0
// Depth images whose rows are read one after the other.
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

// In a fast turn outlines are sheared, in each view otherwise: held against each other as if they had been read at
// once, things that stand are found in space that was seen empty.
TEST(MotionSegmenter, RowsThatAreReadLateAreNoMovers) {
  for (const double readout : {0.0, 0.03}) {
    const TurningCamera turning{readout};
    MotionSegmenter segmenter(plane_test_camera(), SensorNoise());
    double share = 0;
    int frames = 0;
    for (int n = 0; n < 150; ++n) {
      const double t = n * TurningCamera::kInterval;
      RgbdImage image;
      image.timestamp = image.depth_timestamp = t;
      image.depth = view_with_boards(turning, t, 100 + static_cast<uint64_t>(n));
      segmenter.observe(image, turning.cam_from_world(t), axis_covariance(0.01, 0.03));
      const MoverMask mask = segmenter.mask();
      if (n >= 90) {
        const auto moving = std::count(mask.cells.data(), mask.cells.data() + mask.cells.size(), uint8_t{255});
        share += static_cast<double>(moving) / static_cast<double>(mask.cells.size());
        ++frames;
      }
      segmenter.commit(turning.cam_from_world(t));
    }
    EXPECT_LT(share / frames, 0.002) << readout;  // 0.02 without
  }
}

}  // namespace
}  // namespace dkb
