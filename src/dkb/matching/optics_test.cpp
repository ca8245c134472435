// SPDX-License-Identifier: Apache-2.0
#include "dkb/matching/optics.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

TEST(Optics, WhatIsWellInViewIsInView) {
  CameraModel barrel = *builtin_camera("fr3");
  barrel.k1 = -0.2;
  barrel.k2 = 0.03;
  for (const CameraModel& camera : {*builtin_camera("fr1"), *builtin_camera("fr3"), barrel}) {
    const Optics optics(camera);
    int well = 0, in_view = 0;
    for (int v = -200; v < 700; v += 2)
      for (int u = -200; u < 900; u += 2) {
        const bool seen = pixel_in_view(camera, camera.unproject(Eigen::Vector2d(u, v), 2)).has_value();
        in_view += seen;
        if (!optics.well_in_view(static_cast<float>(u), static_cast<float>(v))) continue;
        ++well;
        EXPECT_TRUE(seen) << u << " " << v;
      }
    EXPECT_GT(well, 0.85 * in_view);
  }
}

TEST(Optics, LengthsInTheImageAreAngles) {
  CameraModel camera;
  camera.fx = camera.fy = 2 * kUsualFocal;
  const Optics optics(camera);
  EXPECT_DOUBLE_EQ(optics.pixels(10), 20);
  EXPECT_DOUBLE_EQ(optics.corner_variance(Keypoint{}), 4);  // of 1 px where the focal length is usual
  EXPECT_EQ(depth_cell(camera), 8);
  camera.fx = 535.4;
  EXPECT_EQ(depth_cell(camera), 4);
  camera.fx = 100;
  EXPECT_EQ(depth_cell(camera), 2);
}

}  // namespace
}  // namespace dkb
