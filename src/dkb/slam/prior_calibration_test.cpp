// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/prior_calibration.h"

#include <gtest/gtest.h>

#include "dkb/image/rgbd_image.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr double kClaimed = 0.002, kSeen = 0.0005;  // [m, rad] standard deviations

// A robot drives ahead and to the left, 3 cm and 2 degrees a frame.
const Rigid3 kStep = rigid3_from_tangent((Vector6d() << 0.005, 0, 0.03, 0.002, -0.035, 0).finished());

Frame frame_with(const MotionPrior& prior) {
  Frame frame(std::make_shared<const RgbdImage>(), 0, 0);
  frame.set_prior(prior);
  return frame;
}

Rigid3 noise(Random& random, double sd) {
  Vector6d off;
  for (int i = 0; i < 6; ++i) off[i] = sd * random.normal();
  return rigid3_from_tangent(off);
}

// What a prior that claims kClaimed is scaled by after `steps` of it, of which `wrong(i)` is the error.
template <class Wrong>
PriorCalibration after(int steps, const Wrong& wrong, bool rotation_only = false) {
  Random random(7);
  PriorCalibration calibration;
  for (int i = 0; i < steps; ++i) {
    const MotionPrior told{kStep * wrong(i, random), rotation_only, kClaimed * kClaimed * Matrix6d::Identity()};
    const MotionPrior seen{kStep * noise(random, kSeen), false, kSeen * kSeen * Matrix6d::Identity()};
    calibration.add(*calibration.calibrated(frame_with(told)).prior(), seen);
  }
  return calibration;
}

double scale_of(const PriorCalibration& calibration) {
  const MotionPrior prior{{}, false, Matrix6d::Identity()};
  return calibration.calibrated(frame_with(prior)).prior()->covariance(4, 4);
}

TEST(PriorCalibration, LeavesAPriorThatKeepsItsWordAsItIs) {
  const auto honest = after(300, [](int, Random& r) { return noise(r, kClaimed); });
  EXPECT_NEAR(scale_of(honest), 1, 0.15);
  EXPECT_FALSE(honest.contradicts_images());
  EXPECT_EQ(scale_of(after(300, [](int, Random& r) { return noise(r, 0.1 * kClaimed); })), 1) << "never a smaller one";
}

TEST(PriorCalibration, LearnsHowFarAPriorIsOff) {
  const auto proud = after(300, [](int, Random& r) { return noise(r, 3 * kClaimed); });
  // Of sums of both variances, (9 * 4 + .25) / (4 + .25), with 20 steps beside these that are as they should be.
  const double expected = (300 * 36.25 / 4.25 + 20) / 320;
  EXPECT_NEAR(scale_of(proud), expected, 1);
  const auto turns = after(
      300, [](int, Random& r) { return noise(r, 3 * kClaimed); }, true);
  EXPECT_NEAR(scale_of(turns), expected, 1.5) << "of three numbers rather than six";
}

TEST(PriorCalibration, TellsMotionsOfTheBaseFromThoseOfTheCamera) {
  // cam_from_base: x ahead becomes z, y to the left -x.
  Eigen::Matrix3d axes;
  axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Rigid3 cam_from_base(Eigen::Quaterniond(axes), Eigen::Vector3d::Zero());
  const Rigid3 of_base = cam_from_base.inverse() * kStep * cam_from_base;
  const auto wrong = [&](int, Random&) { return kStep.inverse() * of_base; };
  EXPECT_FALSE(after(10, wrong).contradicts_images()) << "so few may be the images' fault";
  EXPECT_TRUE(after(40, wrong).contradicts_images());
  EXPECT_GT(scale_of(after(40, wrong)), 50);
}

TEST(PriorCalibration, BearsStepsThatSlip) {
  const auto slips = after(300, [](int i, Random& r) { return noise(r, i % 4 == 0 ? 100 * kClaimed : kClaimed); });
  EXPECT_LT(scale_of(slips), 2);
  EXPECT_FALSE(slips.contradicts_images());
}

TEST(PriorCalibration, ForgetsWhatIsLongAgo) {
  const auto mended = after(900, [](int i, Random& r) { return noise(r, i < 300 ? 10 * kClaimed : kClaimed); });
  EXPECT_LT(scale_of(mended), 1.2);
}

}  // namespace
}  // namespace dkb
