// SPDX-License-Identifier: Apache-2.0
// SlamSystem fed frame by frame. The frames come from the simulator here; a camera driver or a ROS node takes its
// place.
#include <cstdio>
#include <memory>

#include "dkb/simulator/simulator.h"
#include "dkb/slam/slam_system.h"

int main() {
  dkb::SimulatorOptions scene;
  scene.frames = 15;
  scene.width = 320;
  scene.height = 240;
  const dkb::Simulator source(scene);

  dkb::SlamSystem slam(source.camera());
  for (int i = 0; i < source.frames(); ++i) {
    const auto image = std::make_shared<const dkb::RgbdImage>(source.render(i).image);
    const dkb::FrameResult result = slam.process(image);  // tracks on this thread, maps beside it
    if (!result.tracked()) continue;
    const auto& at = result.world_from_cam.translation;
    std::printf("%.3f s  %s at %+.3f %+.3f %+.3f m by %d points\n", result.timestamp, name_of(result.state), at.x(),
                at.y(), at.z(), result.inliers);
  }
  slam.finish();
  std::printf("%zu map points\n", slam.map()->point_count());
  return slam.trajectory().size() == static_cast<size_t>(source.frames()) ? 0 : 1;
}
