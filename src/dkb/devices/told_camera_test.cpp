// SPDX-License-Identifier: Apache-2.0
#include "dkb/devices/told_camera.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

DkbDeviceCamera told_by_a_d455() {
  DkbDeviceCamera told{};
  told.width = 640, told.height = 480, told.fps = 30, told.depth_factor = 1000;
  told.fx = 385, told.fy = 384.5, told.cx = 321.5, told.cy = 243;
  told.k1 = -0.0565, told.k2 = 0.0682, told.p1 = 0.0003, told.p2 = -0.0005, told.k3 = -0.0217;
  told.lens = dkb_lens_inverse;
  return told;
}

TEST(ToldCamera, AnInverseLensIsFitted) {
  const DkbDeviceCamera told = told_by_a_d455();
  const ToldCamera made = told_camera(told);
  EXPECT_EQ(made.reason, "");
  const Camera& camera = made.camera;
  EXPECT_EQ(camera.fx, 385);
  EXPECT_GT(camera.k1, 0.03) << "it is turned round: the sign of the first one is the other";
  EXPECT_NO_THROW(camera.check());
  double largest = 0;
  for (double v = 0; v < 480; v += 7)
    for (double u = 0; u < 640; u += 7) {
      const double x = (u - told.cx) / told.fx, y = (v - told.cy) / told.fy, r2 = x * x + y * y;
      const double f = 1 + told.k1 * r2 + told.k2 * r2 * r2 + told.k3 * r2 * r2 * r2;
      const Eigen::Vector2d ideal(x * f + 2 * told.p1 * x * y + told.p2 * (r2 + 2 * x * x),
                                  y * f + 2 * told.p2 * x * y + told.p1 * (r2 + 2 * y * y));
      const Eigen::Vector2d pixel = camera.project({ideal.x(), ideal.y(), 1});
      largest = std::max(largest, (camera.distort(pixel) - Eigen::Vector2d(u, v)).norm());
      EXPECT_LT((camera.undistort({u, v}) - pixel).norm(), 0.1) << u << " " << v;
    }
  EXPECT_LT(largest, 0.1);
  // As they are, the coefficients would be off by twice the distortion.
  Camera as_it_is = camera;
  as_it_is.k1 = told.k1, as_it_is.k2 = told.k2, as_it_is.p1 = told.p1, as_it_is.p2 = told.p2, as_it_is.k3 = told.k3;
  EXPECT_GT((as_it_is.distort({600, 440}) - camera.distort({600, 440})).norm(), 3);
}

TEST(ToldCamera, AnInverseLensThatOursDoesNotMeetIsRefusedWithItsReason) {
  DkbDeviceCamera told = told_by_a_d455();
  told.k1 = -0.9;
  const ToldCamera made = told_camera(told);
  EXPECT_EQ(made.camera.fx, 0);
  EXPECT_NE(made.reason.find("its lens, told by the inverse Brown-Conrady model, is met by ours only within"),
            std::string::npos)
      << made.reason;
}

TEST(ToldCamera, AnInverseLensWithoutDistortionHasNone) {
  DkbDeviceCamera told = told_by_a_d455();
  told.k1 = told.k2 = told.p1 = told.p2 = told.k3 = 0;
  EXPECT_FALSE(told_camera(told).camera.distorted());
  EXPECT_EQ(told_camera(told).camera.fx, 385);
}

TEST(ToldCamera, OtherLensesAreRefusedAndSilentDevicesSaySo) {
  DkbDeviceCamera told = told_by_a_d455();
  told.lens = dkb_lens_other;
  EXPECT_EQ(told_camera(told).camera.fx, 0);
  EXPECT_EQ(told_camera(told).camera.depth_factor, 1000);
  EXPECT_NE(told_camera(told).reason.find("its lens is told by a model that is none of ours"), std::string::npos);
  told.fx = 0;
  EXPECT_EQ(told_camera(told).reason, "does not tell its camera");
}

TEST(ToldCamera, RationalLensesAreTakenAndImpossibleOnesRefused) {
  DkbDeviceCamera told = told_by_a_d455();
  told.lens = dkb_lens_forward;
  told.k1 = 0.6, told.k2 = -2.7, told.p1 = 0.0006, told.p2 = -0.0002, told.k3 = 1.5;
  told.k4 = 0.48, told.k5 = -2.5, told.k6 = 1.45;
  const ToldCamera made = told_camera(told);
  EXPECT_EQ(made.reason, "");
  EXPECT_TRUE(made.camera.rational());
  EXPECT_EQ(made.camera.k6, 1.45);
  told.k4 = -20;
  EXPECT_EQ(told_camera(told).camera.fx, 0);
  EXPECT_NE(told_camera(told).reason.find("no ray at pixel"), std::string::npos) << told_camera(told).reason;
}

TEST(ToldCamera, UnitsOfDepthAreWholeWhereTheyAreMeantToBe) {
  EXPECT_EQ(depth_factor_of(0.001F), 1000);
  EXPECT_EQ(depth_factor_of(0.0001F), 10000);
  EXPECT_EQ(depth_factor_of(0.00025F), 4000);
  EXPECT_EQ(depth_factor_of(0.0003), 1 / 0.0003);
  EXPECT_EQ(depth_factor_of(0), 0) << "not told";
}

}  // namespace
}  // namespace dkb
