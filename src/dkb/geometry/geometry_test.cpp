// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/motion_model.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

Rigid3 random_motion(Random& r) {
  return {rotation_from_vector({r.normal(), r.normal(), r.normal()}), {r.normal(), r.normal(), r.normal()}};
}

TEST(Rigid3, InverseUndoesTheMotion) {
  Random r(1);
  for (int i = 0; i < 20; ++i) {
    const Rigid3 b_from_a = random_motion(r);
    const Eigen::Vector3d p{r.normal(), r.normal(), r.normal()};
    EXPECT_NEAR((b_from_a.inverse() * (b_from_a * p) - p).norm(), 0, 1e-12);
    EXPECT_NEAR((b_from_a * centre_in_world(b_from_a)).norm(), 0, 1e-12);
  }
}

TEST(Camera, TellsHowAnImagePointMovesAsTheNumericDerivativeDoes) {
  const Camera camera = *builtin_camera("fr1");
  const Eigen::Vector3d point(0.4, -0.3, 1.7);
  const double h = 1e-6;
  for (int i = 0; i < 6; ++i) {
    const auto moved = [&](double by) {
      const Vector6d d = by * Vector6d::Unit(i);
      return camera.project(point + d.head<3>() + d.tail<3>().cross(point));
    };
    const Eigen::Vector2d numeric = (moved(h) - moved(-h)) / (2 * h);
    EXPECT_LT((pixel_by_motion(camera, point).col(i) - numeric).norm(), 1e-6 * camera.fx) << i;
  }
}

TEST(VelocityFilter, WeighsWhatIsMeasuredByItsNoise) {
  VelocityFilter filter;
  const Matrix6d exact = axis_covariance(1e-6, 1e-6), noisy = axis_covariance(0.5, 0.5);
  const Vector6d speed = Vector6d::Constant(0.2);
  filter.update(speed, exact, 0.1);
  EXPECT_LT((filter.velocity() - speed).norm(), 1e-9);
  // By hand: 0.1 s of 2 m/s^2 leave a variance of 0.04 beside 0.25, those of 6 rad/s^2 one of 0.36.
  filter.update(Vector6d::Zero(), noisy, 0.1);
  EXPECT_NEAR(filter.velocity()[0], 0.2 * (1 - 0.04 / 0.29), 1e-6);
  EXPECT_NEAR(filter.velocity()[5], 0.2 * (1 - 0.36 / 0.61), 1e-6);
  EXPECT_NEAR(filter.covariance(0, 0)(0, 0), 0.04 * 0.25 / 0.29, 1e-6);
  // From 0.1 s on to 0.2 s: the change of speed has reached its bound of twice the speed's variance, that of turns has
  // none.
  const Matrix6d later = filter.covariance(0.1, 0.2) - filter.covariance(0, 0);
  EXPECT_NEAR(later(0, 0), 0.08 - 0.04, 1e-9);
  EXPECT_NEAR(later(5, 5), 36 * (0.04 - 0.01), 1e-9);
}

TEST(VelocityFilter, AStepOverAMillisecondTellsNextToNothing) {
  VelocityFilter filter(Vector6d::Constant(0.2), axis_covariance(0.05, 0.05));
  // Two poses of 1 mm, 1 mrad: 1.4 m/s, against 0.05.
  filter.update(Vector6d::Constant(3), axis_covariance(std::sqrt(2.0), std::sqrt(2.0)), 0.001);
  EXPECT_LT((filter.velocity() - Vector6d::Constant(0.2)).norm(), 0.01);
  filter.go_on(0.1);
  EXPECT_NEAR(filter.covariance(0, 0)(0, 0), 0.0025 + 0.04, 1e-4);
  EXPECT_NEAR(filter.velocity()[0], 0.2, 0.01);
}

TEST(MotionModel, AHandKeepsItsSpeedsInBounds) {
  EXPECT_NEAR(velocity_change_sd(0.05), 0.1, 1e-12);
  EXPECT_NEAR(velocity_change_sd(10), std::sqrt(0.08), 1e-12);
  EXPECT_NEAR(position_change_sd(0.1), 0.01, 1e-12);
  // The integral of the velocity's: by steps of 1 ms.
  double sum = 0;
  for (double t = 0.5e-3; t < 1; t += 1e-3) sum += 1e-3 * velocity_change_sd(t);
  EXPECT_NEAR(position_change_sd(1), sum, 1e-6);
}

TEST(VelocityFilter, FollowsNoisyStepsWithinItsCovariance) {
  Random random(3);
  VelocityFilter filter;
  const double dt = 1.0 / 30, noise = 0.1;
  double speed = 0, sum = 0;
  const int frames = 600;
  for (int i = 0; i < frames; ++i) {
    speed += kAccelerationSd * dt * random.normal();
    Vector6d measured = Vector6d::Zero();
    measured[0] = speed + noise * random.normal();
    filter.update(measured, axis_covariance(noise, noise), dt);
    const double error = filter.velocity()[0] - speed;
    sum += error * error / filter.covariance(0, 0)(0, 0);
  }
  EXPECT_GT(sum / frames, 0.7);
  EXPECT_LT(sum / frames, 1.4);
}

TEST(Rigid3, ProductAppliesTheRightOperandFirst) {
  Random r(2);
  const Rigid3 b_from_a = random_motion(r), c_from_b = random_motion(r);
  const Eigen::Vector3d p(1, 2, 3);
  EXPECT_NEAR(((c_from_b * b_from_a) * p - c_from_b * (b_from_a * p)).norm(), 0, 1e-12);
}

TEST(Rigid3, RotationVectorRoundTrips) {
  Random r(3);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d w = Eigen::Vector3d{r.normal(), r.normal(), r.normal()}.normalized() * r.uniform(0, 3.1);
    EXPECT_NEAR((vector_from_rotation(rotation_from_vector(w)) - w).norm(), 0, 1e-9);
  }
  EXPECT_NEAR((vector_from_rotation(rotation_from_vector({1e-14, 0, 0}))).norm(), 1e-14, 1e-16);
}

TEST(CameraModel, ProjectsByHandComputedNumbers) {
  CameraModel c;  // fx = fy = 525, centre (319.5, 239.5)
  const Eigen::Vector2d p = c.project({0.2, -0.1, 2.0});
  EXPECT_DOUBLE_EQ(p.x(), 319.5 + 52.5);
  EXPECT_DOUBLE_EQ(p.y(), 239.5 - 26.25);
  EXPECT_NEAR((c.unproject(p, 2.0) - Eigen::Vector3d(0.2, -0.1, 2.0)).norm(), 0, 1e-12);
}

TEST(CameraModel, UndistortInvertsDistortOverTheWholeImage) {
  for (const char* name : {"fr1", "fr2", "bonn"}) {
    const CameraModel c = *builtin_camera(name);
    for (int y = 0; y < c.height; y += 40)
      for (int x = 0; x < c.width; x += 40) {
        const Eigen::Vector2d pixel(x, y);
        EXPECT_NEAR((c.distort(c.undistort(pixel)) - pixel).norm(), 0, 1e-6) << name << " " << x << " " << y;
      }
  }
}

TEST(CameraModel, UndistortInvertsDistortOfAWideLens) {
  CameraModel c;
  c.fx = c.fy = 300, c.k1 = -0.32, c.k2 = 0.09;  // the slope 1 - 0.96 u + 0.45 u^2 has no root: it does not fold
  c.check();
  for (int y = 0; y < c.height; y += 9)
    for (int x = 0; x < c.width; x += 9) {
      const Eigen::Vector2d pixel(x, y);
      EXPECT_NEAR((c.distort(c.undistort(pixel)) - pixel).norm(), 0, 1e-6) << x << " " << y;
    }
}

TEST(CameraModel, ThatFoldsWithinTheImageIsRefused) {
  CameraModel c;
  c.fx = c.fy = 300, c.k1 = -0.32;  // 1 - 0.96 u = 0 at tan = 1.02, which is 0.68 in the image; the corner is at 1.33
  EXPECT_EQ(test::input_error_of([&] { c.check(); }).rfind("k1: ", 0), 0U);
  EXPECT_THROW(c.set_distortion("plumb_bob", {-0.32, 0, 0, 0, 0}), InputError);
  for (const char* name : {"fr1", "fr2", "fr3", "bonn"}) EXPECT_NO_THROW(builtin_camera(name)->check()) << name;
}

TEST(CameraModel, DistortsByHandComputedNumbers) {
  CameraModel c;
  c.fx = c.fy = 100, c.cx = c.cy = 50, c.width = c.height = 100;
  c.k1 = 0.1, c.p1 = 0.01, c.p2 = 0.02;
  // x = 0.5, y = 0.2, r2 = 0.29, radial = 1.029
  // xd = 0.5145 + 2*0.01*0.1 + 0.02*(0.29 + 0.5) = 0.5323; yd = 0.2058 + 0.01*(0.29 + 0.08) + 2*0.02*0.1 = 0.2135
  const Eigen::Vector2d d = c.distort({100, 70});
  EXPECT_NEAR(d.x(), 103.23, 1e-9);
  EXPECT_NEAR(d.y(), 71.35, 1e-9);
}

TEST(CameraModel, ShowsNoPointTwice) {
  const CameraModel c = *builtin_camera("bonn");
  // 1 + 3 k1 u + 5 k2 u^2 = 0 at u = 1.545, tan = 1.243; at tan = 1.7 the polynomial is back inside the image.
  const Eigen::Vector3d aside(1.7, 0, 1);
  EXPECT_LT(c.distort(c.project(aside)).x(), c.width);
  EXPECT_FALSE(image_pixel(c, aside));
  EXPECT_FALSE(image_pixel(c, {1.25, 0, 1}));
  EXPECT_GT(image_pixel(c, {1.24, 0, 1})->x(), c.width);
  EXPECT_FALSE(image_pixel(c, {0, 0, -1}));
  const Eigen::Vector3d ahead(0.3, -0.2, 1.5);
  EXPECT_EQ(*image_pixel(c, ahead), c.distort(c.project(ahead)));
  CameraModel plain;
  EXPECT_EQ(*image_pixel(plain, aside), plain.project(aside));
}

TEST(CameraModel, ImageGrowsOutwardsWhereASearchSaysSo) {
  Random random(5);
  int folded = 0;
  for (int i = 0; i < 2000; ++i) {
    CameraModel c;
    c.k1 = random.uniform(-0.6, 0.6), c.k2 = random.uniform(-1, 1), c.k3 = i % 3 == 0 ? 0 : random.uniform(-1, 1);
    const double tangent = random.uniform(0.1, 2);
    const auto radius = [&](double t) { return t * (1 + t * t * (c.k1 + t * t * (c.k2 + t * t * c.k3))); };
    double least = 1;  // step of the radius
    for (int k = 0; k < 2000; ++k)
      least = std::min(least, (radius(tangent * (k + 1) / 2000) - radius(tangent * k / 2000)) * 2000 / tangent);
    if (std::abs(least) < 0.01) continue;  // too near to tell by steps
    folded += least < 0;
    EXPECT_EQ(image_pixel(c, {0, tangent, 1}).has_value(), least > 0) << c.k1 << " " << c.k2 << " " << c.k3;
  }
  EXPECT_GT(folded, 200);
  EXPECT_LT(folded, 1800);
}

// As the driver of Azure Kinect tells its colour camera.
CameraModel azure_kinect() {
  CameraModel c;
  c.width = 1280, c.height = 720, c.fx = c.fy = 606, c.cx = 639, c.cy = 365;
  c.set_distortion("rational_polynomial", {0.5, -2.6, 0.0007, -0.0002, 1.5, 0.38, -2.45, 1.43});
  return c;
}

TEST(RationalDistortion, DistortsByHandComputedNumbers) {
  CameraModel c;
  c.fx = c.fy = 100, c.cx = c.cy = 50, c.width = c.height = 100;
  c.set_distortion("rational_polynomial", {0.5, 0, 0.01, 0.02, 0, 0.2, 0, 1, 0, 0, 0, 0});
  // x = 0.5, y = 0.2, r2 = 0.29: 1.145 / (1 + 0.058 + 0.024389) = 1.0578451...
  const double radial = 1.145 / 1.082389;
  const Eigen::Vector2d d = c.distort({100, 70});
  EXPECT_NEAR(d.x(), 50 + 100 * (0.5 * radial + 2 * 0.01 * 0.1 + 0.02 * (0.29 + 0.5)), 1e-9);
  EXPECT_NEAR(d.y(), 50 + 100 * (0.2 * radial + 0.01 * (0.29 + 0.08) + 2 * 0.02 * 0.1), 1e-9);
}

TEST(RationalDistortion, UndistortInvertsItOverTheWholeImage) {
  const CameraModel c = azure_kinect();
  for (int y = 0; y < c.height; y += 9)
    for (int x = 0; x < c.width; x += 9) {
      const Eigen::Vector2d pixel(x, y), ideal = c.undistort(pixel);
      EXPECT_NEAR((c.distort(ideal) - pixel).norm(), 0, 1e-6) << x << " " << y;
      const auto seen = image_pixel(c, c.unproject(ideal, 2));
      ASSERT_TRUE(seen) << x << " " << y;
      EXPECT_NEAR((*seen - pixel).norm(), 0, 1e-6);
    }
}

TEST(RationalDistortion, ImageGrowsOutwardsWhereASearchSaysSo) {
  Random random(6);
  int folded = 0, grown = 0;
  for (int i = 0; i < 2000; ++i) {
    CameraModel c;
    for (double* k : {&c.k1, &c.k2, &c.k3, &c.k4, &c.k5, &c.k6}) *k = random.uniform(-0.5, 0.5);
    const double tangent = random.uniform(0.1, 1.5);
    const auto below = [&](double u) { return 1 + u * (c.k4 + u * (c.k5 + u * c.k6)); };
    const auto radius = [&](double t) {
      const double u = t * t;
      return t * (1 + u * (c.k1 + u * (c.k2 + u * c.k3))) / below(u);
    };
    double least = 1;
    for (int k = 0; k < 2000; ++k) {
      const double t = tangent * k / 2000, next = tangent * (k + 1) / 2000;
      least = std::min({least, (radius(next) - radius(t)) / (next - t), below(next * next)});
    }
    if (std::abs(least) < 0.03) continue;  // too near to tell by steps
    (least < 0 ? folded : grown) += 1;
    EXPECT_EQ(image_pixel(c, {0, tangent, 1}).has_value(), least > 0) << i;
  }
  EXPECT_GT(folded, 200);
  EXPECT_GT(grown, 200);
}

TEST(RationalDistortion, WhatIsOfNoLensIsRefusedAndTheCameraIsAsItWas) {
  CameraModel c = azure_kinect();
  const auto refused = [&](const std::string& model, const std::vector<double>& coefficients) -> std::string {
    try {
      c.set_distortion(model, coefficients);
    } catch (const InputError& e) {
      EXPECT_EQ(c.k4, 0.38);
      return e.what();
    }
    return "taken";
  };
  // The divisor is 0 at a tangent of 0.58, and so 350 px from the middle.
  EXPECT_EQ(refused("rational_polynomial", {0, 0, 0, 0, 0, -3, 0, 0}),
            "its coefficients of distortion give no ray at pixel (0, 0), as no lens does");
  CameraModel written_by_hand = c;
  written_by_hand.k4 = -3;
  EXPECT_THROW(written_by_hand.check(), InvalidOption);
  EXPECT_NO_THROW(c.check());
  EXPECT_EQ(refused("equidistant", {0.1, 0, 0, 0}),
            "its distortion model equidistant is none of ours (plumb_bob, rational_polynomial)");
  EXPECT_EQ(refused("plumb_bob", {0.1, 0, 0, 0, 0, 0.1}), "6 coefficients of distortion, 4 to 5 expected");
  EXPECT_EQ(refused("rational_polynomial", {0.1}), "1 coefficients of distortion, 4 to 8 expected");
  EXPECT_EQ(refused("", {0.1, 0.2, 0.03, 0.04}), "taken");
  EXPECT_EQ(c.p2, 0.04);
  EXPECT_FALSE(c.rational());
  c.set_distortion("equidistant", {0, 0, 0, 0});
  EXPECT_FALSE(c.distorted());
}

TEST(CameraModel, CheckNamesTheFieldThatIsWrong) {
  CameraModel c;
  c.fx = -1;
  try {
    c.check();
    FAIL() << "must throw";
  } catch (const InvalidOption& e) {
    EXPECT_EQ(std::string(e.what()).substr(0, 3), "fx:");
  }
  EXPECT_FALSE(builtin_camera("fr9").has_value());
}

}  // namespace
}  // namespace dkb
