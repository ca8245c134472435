// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/detection/detection.h"
#include "dkb/dynamics/mover_mask.h"
#include "dkb/geometry/camera.h"

namespace dkb {

// A 320 x 240 camera that looks at a wall, and flat upright figures before it: a scene with known answers for tests.
struct MoverTestScene {
  CameraModel camera;
  DepthImage depth;
  MoverMask mask;
  std::vector<Detection> boxes;  // of the visible pixels

  explicit MoverTestScene(float wall = 5.0f) {
    camera.width = 320;
    camera.height = 240;
    camera.fx = camera.fy = 250;
    camera.cx = 159.5;
    camera.cy = 119.5;
    depth = DepthImage(320, 240, wall);
    mask.cell = 4;
    mask.cells = Image<uint8_t>(80, 60);
  }

  // Draws pixels x0 <= x < x1, y0 <= y < y1 at `z` [m] where nothing nearer is, and marks the cells that they cover.
  void add(int x0, int y0, int x1, int y1, float z, bool with_box = true) {
    int left = 320, right = 0;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) {
        if (!depth.contains(x, y) || depth(x, y) < z) continue;
        depth(x, y) = z;
        mask.cells(x / 4, y / 4) = 255;
        left = x < left ? x : left;
        right = x + 1 > right ? x + 1 : right;
      }
    if (with_box && right > left)
      boxes.push_back({"person",
                       {static_cast<float>(left), static_cast<float>(y0), static_cast<float>(right - left),
                        static_cast<float>(y1 - y0)},
                       1});
  }
};

}  // namespace dkb
