// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/planes.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/features/plane_test_scene.h"
#include "dkb/mapping/ba_window.h"
#include "dkb/mapping/test_map.h"

namespace dkb {
namespace {

// Keyframes without a single feature, which move on before walls and know of each other by depth alone.
class Planes : public ::testing::Test {
 protected:
  void look(const Rigid3& truth, const Rigid3& estimate, const std::vector<TestPlane>& planes = corner_of_a_room()) {
    Keyframe k;
    k.id = map.keyframe_count();
    k.cam_from_world = estimate;
    k.features = std::make_shared<const RgbdFeatures>();
    k.parent = k.id - 1;
    if (k.id > 0)
      k.motion = std::make_shared<const KeyframeMotion>(
          KeyframeMotion{k.id - 1, {{}, false, 1e6 * Matrix6d::Identity()}});  // which say nothing
    k.planes =
        std::make_shared<const PlaneView>(finder.find(view_of(planes, truth, static_cast<uint64_t>(k.id) + 1), {}));
    const KeyframeId id = k.id;
    map.add_keyframe(std::move(k));
    recogniser.recognise(map, id);
  }
  static Rigid3 pose_at(int k) {
    return Rigid3(rotation_from_vector({0.02 * k, 0.03 * k, 0}), {0.02 * k, 0.01 * k, -0.03 * k});
  }
  BaProblem problem(std::vector<KeyframeId> keyframes) const {
    BaProblem p;
    p.camera = camera;
    for (KeyframeId k : keyframes) p.cam_from_world.push_back(map.keyframe(k)->cam_from_world);
    p.fixed.assign(keyframes.size(), 0);
    p.fixed[0] = 1;
    add_planes(map, keyframes, p);
    return p;
  }
  std::vector<PlaneId> names(KeyframeId id) const {
    std::vector<PlaneId> planes;
    for (PlaneId p : map.keyframe(id)->plane_of_patch) planes.push_back(map.plane(p));
    std::sort(planes.begin(), planes.end());
    return planes;
  }

  CameraModel camera = plane_test_camera();
  PlaneFinder finder{camera, SensorNoise()};
  PlaneRecogniser recogniser{camera, SensorNoise()};
  Map map;
};

TEST_F(Planes, AreKnownAgainInTheNextKeyframe) {
  for (int k = 0; k < 4; ++k) look(pose_at(k), pose_at(k));
  for (KeyframeId k = 0; k < 4; ++k) EXPECT_EQ(names(k), (std::vector<PlaneId>{0, 1, 2})) << k;
}

TEST_F(Planes, AreKnownAgainWhereThePoseIsOffByWhatATurnLoses) {
  look({}, {});
  look({}, Rigid3(rotation_from_vector({0.02, 0, 0.01}), {0.01, 0.01, 0}));
  EXPECT_EQ(names(1), names(0));
}

TEST_F(Planes, AWallBehindTheOneThatWasSeenIsAnother) {
  const std::vector<TestPlane> near = {{Eigen::Vector3d(0, 0, 1), 2.0}}, far = {{Eigen::Vector3d(0, 0, 1), 2.3}};
  look({}, {}, near);
  look({}, {}, far);
  EXPECT_EQ(names(0), (std::vector<PlaneId>{0}));
  EXPECT_EQ(names(1), (std::vector<PlaneId>{1}));
}

// A keyframe that sees both sides of what hid the middle of a wall tells that they are one.
TEST_F(Planes, OfTwoNamesTheOlderStaysWhereAPlaneTurnsOutToBeOne) {
  look({}, {}, {{Eigen::Vector3d(0, 0, 1), 2.0}});
  Map two = map;
  two.append(map);
  map = two;
  map.update_covisibility(0, 1);
  EXPECT_EQ(map.plane(map.keyframe(1)->plane_of_patch[0]), 1) << "another map's, until somebody has looked";
  map.join_planes(1, 0);
  EXPECT_EQ(map.plane(1), 0);
  EXPECT_EQ(map.plane(map.keyframe(1)->plane_of_patch[0]), 0);
}

TEST_F(Planes, TakeNoPartWhereFewKeyframesSeeThem) {
  for (int k = 0; k < 3; ++k) look(pose_at(k), pose_at(k));
  const BaProblem p = problem({0, 1, 2});
  EXPECT_EQ(p.cam_from_world.size(), 3u);
  EXPECT_TRUE(p.motions.empty());
}

// As those of a map that was loaded.
TEST_F(Planes, TakeNoPartWhereTheyAreNotWanted) {
  for (int k = 0; k < 6; ++k) look(pose_at(k), pose_at(k));
  const auto motions = [&](bool planes) {
    return make_ba_window(map, {0, 1, 2, 3, 4, 5}, {1, 1, 1, 1, 1, 0}, {}, Optics(camera), planes)
        .problem.motions.size();
  };
  EXPECT_EQ(motions(false), 1U) << "the keyframe's own";
  EXPECT_GT(motions(true), 1U);
}

// Three planes that are not parallel say all of a pose.
TEST_F(Planes, AloneBringCamerasToWhereTheyAre) {
  std::vector<Rigid3> truth;
  for (int k = 0; k < 6; ++k) {
    truth.push_back(pose_at(k));
    const double s = k % 2 == 0 ? 1 : -1;
    const Rigid3 error(rotation_from_vector({0.01 * s, -0.008, 0.005 * s}), {0.01 * s, 0.01, -0.01 * s});
    look(truth.back(), k == 0 ? truth.back() : error * truth.back());
  }
  BaProblem p = problem({0, 1, 2, 3, 4, 5});
  ASSERT_EQ(p.cam_from_world.size(), 9u);
  EXPECT_EQ(p.motions.size(), 18u);
  EXPECT_EQ(p.fixed, (std::vector<uint8_t>{1, 0, 0, 0, 0, 0, 0, 0, 0}));
  bundle_adjust(p);
  for (size_t k = 1; k < 6; ++k) {
    const Rigid3 error = p.cam_from_world[k] * truth[k].inverse();
    EXPECT_LT(error.translation.norm(), 0.004) << k;
    EXPECT_LT(vector_from_rotation(error.rotation).norm(), 0.002) << k;
  }
}

// One wall says of tilt and distance, and leaves a camera where it is in the plane.
TEST_F(Planes, LeaveOpenWhatTheyDoNotTell) {
  const std::vector<TestPlane> wall = {{Eigen::Vector3d(0, 0, 1), 2.0}};
  const Rigid3 off(rotation_from_vector({0.01, 0, 0.2}), {0.3, -0.2, 0.02});
  for (int k = 0; k < 5; ++k) look({}, k == 4 ? off : Rigid3(), wall);
  BaProblem p = problem({0, 1, 2, 3, 4});
  bundle_adjust(p);
  const Rigid3 after = p.cam_from_world[4];
  const Eigen::Vector3d normal = after.rotation * Eigen::Vector3d::UnitZ();  // of the wall, in the camera
  EXPECT_LT(normal.head<2>().norm(), 0.002);
  EXPECT_NEAR(2.0 + normal.dot(after.translation), 2.0, 0.004);
  EXPECT_NEAR(vector_from_rotation(after.rotation).z(), 0.2, 0.002);
  EXPECT_NEAR(after.translation.x(), 0.3, 0.02);
  EXPECT_NEAR(after.translation.y(), -0.2, 0.02);
}

// What an edge makes of the covariance of a patch, against differences of what a camera at the moved pose would see.
TEST_F(Planes, InformationIsThatOfThePatchCarriedToThePlanesPose) {
  for (int k = 0; k < 4; ++k) look(pose_at(k), pose_at(k));
  const BaProblem p = problem({0, 1, 2, 3});
  ASSERT_FALSE(p.motions.empty());
  for (const PoseEdge& e : p.motions) {
    const Keyframe& k = *map.keyframe(e.b);
    const auto at = std::find_if(k.planes->patches.begin(), k.planes->patches.end(), [&](const PlanePatch& patch) {
      return (e.b_from_a.rotation * Eigen::Vector3d::UnitZ()).isApprox(patch.normal(), 1e-9);
    });
    ASSERT_NE(at, k.planes->patches.end());
    EXPECT_NEAR(at->normal().dot(e.b_from_a.translation), at->distance(), 1e-9);
    Eigen::Matrix<double, 3, 6> by_motion;
    constexpr double kStep = 1e-6;
    for (int i = 0; i < 6; ++i) {
      const auto seen = [&](double step) {
        Vector6d d = Vector6d::Zero();
        d[i] = step;
        const Rigid3 cam_from_plane = e.b_from_a * rigid3_from_tangent(d);
        const Eigen::Vector3d normal = cam_from_plane.rotation * Eigen::Vector3d::UnitZ();
        return Eigen::Vector3d(normal / normal.dot(cam_from_plane.translation));
      };
      by_motion.col(i) = (seen(kStep) - seen(-kStep)) / (2 * kStep);
    }
    // Calibration adds to the variances: the edge says no more than the patch, and nothing where the patch says
    // nothing.
    const Matrix6d most = by_motion.transpose() * at->covariance.inverse() * by_motion;
    Vector6d in_plane = Vector6d::Zero();
    in_plane[0] = 1;
    EXPECT_NEAR(in_plane.dot(most * in_plane), 0, 1e-3);
    EXPECT_NEAR(in_plane.dot(e.information * in_plane), 0.01, 1e-9);
    Random random(1);
    for (int n = 0; n < 20; ++n) {
      Vector6d d;
      for (int i = 0; i < 6; ++i) d[i] = random.normal();
      EXPECT_LT(d.dot(e.information * d), d.dot(most * d) + 0.011 * d.squaredNorm());
      EXPECT_GT(d.dot(e.information * d), 0);
    }
  }
}

}  // namespace
}  // namespace dkb
