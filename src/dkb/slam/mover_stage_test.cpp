// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/mover_stage.h"

#include <gtest/gtest.h>

#include <memory>

namespace dkb {
namespace {

// Somebody 2 m before the camera, whose left edge is in this column, at a time [s].
Scene somebody_at(const Camera& camera, int column, double time) {
  auto image = std::make_shared<RgbdImage>();
  image->timestamp = image->depth_timestamp = time;
  image->grey = GreyImage(camera.width, camera.height);
  image->depth = DepthImage(camera.width, camera.height, 4.0F);
  Scene scene;
  scene.mask.cell = 4;
  scene.mask.cells = Image<uint8_t>(camera.width / 4, camera.height / 4);
  for (int y = 80; y < 400; ++y)
    for (int x = column; x < column + 100; ++x) image->depth(x, y) = 2, scene.mask.cells(x / 4, y / 4) = 255;
  const auto stamp = static_cast<int64_t>(1e9 * time);
  scene.extracted.frame = Frame(std::move(image), stamp, stamp);
  return scene;
}

// Positions and velocities of all frames but the lost ones, whose looks nobody finishes.
std::vector<double> followed(bool threaded) {
  const Camera camera;
  MoverStage stage(camera, {}, threaded);
  std::vector<double> told;
  for (int i = 0; i < 30; ++i) {
    const Scene scene = somebody_at(camera, 100 + 7 * i, 1 + i / 30.0);
    stage.begin(scene, Rigid3(Eigen::Quaterniond::Identity(), {0.001 * i, 0, 0}));
    if (i == 10) stage.rebase({Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())), {0, 0, 0.1}});
    if (i % 4 == 3 || i == 10) continue;
    for (const Mover& m : stage.finish(scene, Rigid3(Eigen::Quaterniond::Identity(), {0.0011 * i, 0, 0}))) {
      told.push_back(m.position_in_world.x());
      told.push_back(m.velocity_in_world.x());
      told.push_back(m.covariance(0, 0));
    }
  }
  return told;
}

TEST(MoverStage, FramesThatAreLostAreLookedAtToTheEndWhateverTheThreads) {
  const std::vector<double> alone = followed(false);
  ASSERT_GT(alone.size(), 40U);
  for (int round = 0; round < 20; ++round) ASSERT_EQ(followed(true), alone) << round;
}

}  // namespace
}  // namespace dkb
