// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

Rigid3 random_motion(Random& r) {
  return {rotation_from_vector({r.normal(), r.normal(), r.normal()}), {r.normal(), r.normal(), r.normal()}};
}

TEST(Rigid3, InverseUndoesTheMotion) {
  Random r(1);
  for (int i = 0; i < 20; ++i) {
    const Rigid3 b_from_a = random_motion(r);
    const Eigen::Vector3d p(r.normal(), r.normal(), r.normal());
    EXPECT_NEAR((b_from_a.inverse() * (b_from_a * p) - p).norm(), 0, 1e-12);
    EXPECT_NEAR((b_from_a * centre_in_world(b_from_a)).norm(), 0, 1e-12);
  }
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
    const Eigen::Vector3d w = Eigen::Vector3d(r.normal(), r.normal(), r.normal()).normalized() * r.uniform(0, 3.1);
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
        EXPECT_NEAR((c.distort(c.undistort(pixel)) - pixel).norm(), 0, 1e-3) << name << " " << x << " " << y;
      }
  }
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
