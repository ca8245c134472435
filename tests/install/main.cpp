// SPDX-License-Identifier: Apache-2.0
#include <dkb/slam/slam_system.h>

#include <cstdio>

int main() {
  const dkb::CameraModel camera = dkb::builtin_camera("fr3").value();
  std::vector<uint8_t> grey(640 * 480);           // a wall with a random pattern of 16-pixel squares ...
  std::vector<uint16_t> depth(640 * 480, 10000);  // ... two metres away
  for (uint32_t i = 0; i < grey.size(); ++i) grey[i] = ((i % 640 / 16 + i / 640 / 16 * 40) * 2654435761u + 7) >> 13;

  dkb::SlamSystem slam(camera);
  slam.process(0.0, grey.data(), 1, depth.data());
  const dkb::FrameResult result = slam.process(1.0 / 30, grey.data(), 1, depth.data());
  std::printf("tracked %d, moved %.6f m\n", result.tracked(), result.world_from_cam.translation.norm());
  return result.tracked() && result.world_from_cam.translation.norm() < 1e-3 ? 0 : 1;
}
