// SPDX-License-Identifier: Apache-2.0
#include "dkb/dense/depth_view.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

CameraModel small_camera() {
  CameraModel camera;
  camera.width = 64;
  camera.height = 48;
  camera.fx = camera.fy = 50;
  camera.cx = 31.5;
  camera.cy = 23.5;
  return camera;
}

RgbdImage wall(const CameraModel& camera, float z) {
  RgbdImage image;
  image.grey = GreyImage(camera.width, camera.height, 100);
  image.depth = DepthImage(camera.width, camera.height, z);
  return image;
}

TEST(DepthView, KeepsDepthToAQuarterMillimetreOnAGridOfSteps) {
  const DepthViewMaker maker(small_camera(), {});
  const DepthView view = maker.make(3, wall(small_camera(), 1.2345F), 0, {});
  ASSERT_EQ(view.depth.width(), 32);
  ASSERT_EQ(view.depth.height(), 24);
  for (size_t i = 0; i < view.depth.size(); ++i) ASSERT_EQ(view.depth.data()[i], 4938);
  EXPECT_NEAR(view.metres(5, 5), 1.2345, 1.0 / 8000);
  EXPECT_EQ(view.colour(5, 5), (Rgb{100, 100, 100}));
  // The view's pixel (x, y) is the image's (2 x, 2 y).
  EXPECT_TRUE(maker.camera().ray(4, 6).isApprox(small_camera().unproject({8, 12}, 1)));
}

TEST(DepthView, LeavesOutStepsAndMoversWithAMargin) {
  DenseOptions options;
  options.pixel_step = 1;
  options.mover_margin = 4;
  RgbdImage image = wall(small_camera(), 2);
  image.depth(20, 20) = 1;  // a speck in front
  MoverMask mask;
  mask.cells = Image<uint8_t>(16, 12);
  mask.cells(10, 5) = 255;  // pixels 40 ... 43, 20 ... 23
  const DepthViewMaker maker(small_camera(), options);
  const DepthView view = maker.make(0, image, 0, mask);
  EXPECT_EQ(view.depth(20, 20), 0);
  EXPECT_EQ(view.depth(21, 21), 0);
  EXPECT_GT(view.depth(22, 20), 0);
  EXPECT_EQ(view.depth(40, 20), 0);
  EXPECT_EQ(view.depth(36, 16), 0);
  EXPECT_EQ(view.depth(47, 27), 0);
  EXPECT_GT(view.depth(35, 20), 0);
  EXPECT_GT(view.depth(48, 20), 0);
}

TEST(DepthView, MoversKnownLaterAreTakenOutLikewise) {
  MoverMask mask;
  mask.cells = Image<uint8_t>(16, 12);
  mask.cells(3, 3) = 255;
  const DepthViewMaker maker(small_camera(), {});
  const DepthView at_once = maker.make(0, wall(small_camera(), 2), 0, mask);
  DepthView later = maker.make(0, wall(small_camera(), 2), 0, {});
  EXPECT_NE(later.depth, at_once.depth);
  maker.remove(mask, &later);
  EXPECT_EQ(later.depth, at_once.depth);
}

TEST(DepthView, LooksUpDistortedPixels) {
  CameraModel camera = small_camera();
  camera.k1 = 0.2;
  DenseOptions options;
  options.pixel_step = 1;
  RgbdImage image = wall(camera, 2);
  const Eigen::Vector2d at = camera.distort({10, 8});
  const int u = static_cast<int>(std::floor(at.x() + 0.5)), v = static_cast<int>(std::floor(at.y() + 0.5));
  ASSERT_NE(u, 10);
  image.grey(u, v) = 7;
  EXPECT_EQ(DepthViewMaker(camera, options).make(0, image, 0, {}).colour(10, 8).r, 7);
}

}  // namespace
}  // namespace dkb
