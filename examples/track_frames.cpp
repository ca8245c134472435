// SPDX-License-Identifier: Apache-2.0
// Slam fed frame by frame. The frames come from the simulator here; a camera driver or a ROS node takes its place.
#include <cstdio>

#include "dkb/simulator/simulator.h"
#include "dkb_slam/slam.h"

int main() {
  dkb::SimulatorOptions scene;
  scene.frames = 15;
  scene.width = 320;
  scene.height = 240;
  const dkb::Simulator simulator(scene);

  dkb::Slam slam(simulator.camera());
  for (int i = 0; i < simulator.frames(); ++i) {
    const dkb::RgbdImage image = simulator.render(i).image;
    dkb::FrameInput input;
    input.stamp_ns = static_cast<int64_t>(1e9 * simulator.stamp(i));
    input.colour = {image.colour.data(), scene.width, scene.height, 0, dkb::PixelFormat::rgb8};
    input.depth = {image.depth.data(), scene.width, scene.height, 0, dkb::PixelFormat::depth_f32};
    const dkb::FrameResult result = slam.process(input);  // tracks on this thread, maps beside it
    if (!result.tracked()) continue;
    const auto& at = result.world_from_cam->translation;
    std::printf("%.3f s  %s at %+.3f %+.3f %+.3f m by %d points\n", 1e-9 * static_cast<double>(result.stamp_ns),
                name_of(result.state), at.x(), at.y(), at.z(), result.inliers);
  }
  slam.finish();
  std::printf("%zu map points\n", slam.map().point_count());
  return slam.trajectory().size() == static_cast<size_t>(simulator.frames()) ? 0 : 1;
}
