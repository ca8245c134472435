// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/prior_calibration.h"

#include <gtest/gtest.h>

#include "dkb/geometry/rigid3.h"
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

// After `steps` of a prior that claims `claimed`, of which `wrong(i)` is the error.
template <class Wrong>
PriorCalibration after(int steps, const Wrong& wrong, bool rotation_only = false, double claimed = kClaimed) {
  Random random(7);
  PriorCalibration calibration;
  for (int i = 0; i < steps; ++i) {
    const MotionPrior told{kStep * wrong(i, random), rotation_only, claimed * claimed * Matrix6d::Identity()};
    const MotionPrior seen{kStep * noise(random, kSeen), false, kSeen * kSeen * Matrix6d::Identity()};
    calibration.calibrated(frame_with(told));
    calibration.add(seen);
  }
  return calibration;
}

double scale_of(PriorCalibration calibration) {
  const MotionPrior prior{{}, false, Matrix6d::Identity()};
  return calibration.calibrated(frame_with(prior)).prior()->covariance(4, 4);
}

TEST(PriorCalibration, LeavesAPriorThatKeepsItsWordAsItIs) {
  const auto honest = after(300, [](int, Random& r) { return noise(r, kClaimed); });
  EXPECT_NEAR(scale_of(honest), 1, 0.15);
  EXPECT_FALSE(honest.contradict_images());
  EXPECT_NEAR(scale_of(after(300, [](int, Random& r) { return noise(r, 0.1 * kClaimed); })), 1, 1e-9)
      << "never a smaller one";
}

TEST(PriorCalibration, LearnsHowFarAPriorIsOff) {
  const auto proud = after(300, [](int, Random& r) { return noise(r, 3 * kClaimed); });
  EXPECT_NEAR(scale_of(proud), (300 * 9 + 20) / 320.0, 1) << "with 20 steps beside these that are as they should be";
  const auto turns = after(
      300, [](int, Random& r) { return noise(r, 3 * kClaimed); }, true);
  EXPECT_NEAR(scale_of(turns), (300 * 9 + 20) / 320.0, 1.5) << "of three numbers rather than six";
}

// Where a prior claims to be far more exact than the images are, these must not stand in for its own error.
TEST(PriorCalibration, LearnsHowFarAPriorIsOffThatClaimsToBeExact) {
  constexpr double kReal = 4 * kSeen, kFactor = 40 * 40;
  const auto proud = after(
      300, [](int, Random& r) { return noise(r, kReal); }, false, 0.1 * kSeen);
  EXPECT_GT(scale_of(proud), 0.7 * kFactor);
  EXPECT_LT(scale_of(proud), 1.4 * kFactor);
  EXPECT_FALSE(proud.say_nothing()) << "it is off by 2 mm in 3 cm";
}

// A turn has three degrees of freedom: half of all steps are off by less than 2.4 variances and one in a hundred by
// more than 11.3. A gyroscope that is twice as far off as it says (4 * 2.4 = 9.5) is within that.
TEST(PriorCalibration, TurnsAloneAreJudgedByTheirThreeDegreesOfFreedom) {
  const auto turns = [](double factor) {
    return after(
        300, [factor](int, Random& r) { return noise(r, factor * kClaimed); }, true);
  };
  EXPECT_FALSE(turns(2).contradict_images());
  EXPECT_TRUE(turns(2.6).contradict_images());
}

TEST(PriorCalibration, TellsMotionsOfTheBaseFromThoseOfTheCamera) {
  // cam_from_base: x ahead becomes z, y to the left -x.
  Eigen::Matrix3d axes;
  axes << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  const Rigid3 cam_from_base(Eigen::Quaterniond(axes), Eigen::Vector3d::Zero());
  const Rigid3 of_base = cam_from_base.inverse() * kStep * cam_from_base;
  const auto wrong = [&](int, Random&) { return kStep.inverse() * of_base; };
  EXPECT_FALSE(after(10, wrong).contradict_images()) << "so few may be the images' fault";
  PriorCalibration calibration = after(40, wrong);
  EXPECT_TRUE(calibration.contradict_images());
  EXPECT_FALSE(calibration.calibrated(frame_with({})).prior()) << "that the camera stands still fits better";
  // Somebody mends the axes.
  const MotionPrior right{kStep, false, kClaimed * kClaimed * Matrix6d::Identity()};
  for (int i = 0; i < 100; ++i) {
    calibration.calibrated(frame_with(right));
    calibration.add({kStep, false, kSeen * kSeen * Matrix6d::Identity()});
  }
  EXPECT_TRUE(calibration.calibrated(frame_with(right)).prior());
}

TEST(PriorCalibration, BearsStepsThatSlip) {
  const auto slips = after(300, [](int i, Random& r) { return noise(r, i % 4 == 0 ? 100 * kClaimed : kClaimed); });
  EXPECT_LT(scale_of(slips), 2);
  EXPECT_FALSE(slips.contradict_images());
}

TEST(PriorCalibration, ForgetsWhatIsLongAgo) {
  const auto mended = after(900, [](int i, Random& r) { return noise(r, i < 300 ? 10 * kClaimed : kClaimed); });
  EXPECT_LT(scale_of(mended), 1.2);
}

}  // namespace
}  // namespace dkb
