// SPDX-License-Identifier: Apache-2.0
#include <dkb_slam/slam.h>

#include <cstdio>
#include <vector>

int main() {
  const dkb::Camera camera = dkb::Camera::named("fr3");
  std::vector<uint8_t> grey(640 * 480);           // a wall with a random pattern of 16-pixel squares ...
  std::vector<uint16_t> depth(640 * 480, 10000);  // ... two metres away
  for (uint32_t i = 0; i < grey.size(); ++i) grey[i] = ((i % 640 / 16 + i / 640 / 16 * 40) * 2654435761u + 7) >> 13;

  dkb::Slam slam(camera);
  dkb::FrameInput input;
  input.colour = {grey.data(), 640, 480, 0, dkb::PixelFormat::grey8};
  input.depth = {depth.data(), 640, 480, 0, dkb::PixelFormat::depth_u16};
  slam.process(input);
  input.stamp_ns = 33'333'333;
  const dkb::FrameResult result = slam.process(input);
  if (!result.tracked()) return 1;
  const double moved = result.world_from_cam->translation.norm();
  std::printf("moved %.6f m\n", moved);
  return moved < 1e-3 ? 0 : 1;
}
