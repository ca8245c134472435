// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/plane_finder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dkb/features/plane_test_scene.h"

namespace dkb {
namespace {

Eigen::Vector3d over_distance_of(const TestPlane& plane, const Rigid3& cam_from_world) {
  const Eigen::Vector3d normal = cam_from_world.rotation * plane.normal;
  return normal / (plane.offset + normal.dot(cam_from_world.translation));
}

PlaneView find(const DepthImage& depth, const CameraModel& camera = plane_test_camera()) {
  return PlaneFinder(camera, SensorNoise()).find(depth, {});
}

const PlanePatch& nearest_patch(const PlaneView& view, const Eigen::Vector3d& over_distance) {
  const auto off = [&](const PlanePatch& p) { return (p.over_distance - over_distance).norm(); };
  return *std::min_element(view.patches.begin(), view.patches.end(),
                           [&](const PlanePatch& a, const PlanePatch& b) { return off(a) < off(b); });
}

TEST(PlaneFinder, FindsTheWallsAndTheFloorOfACorner) {
  const Rigid3 pose(rotation_from_vector({0.2, -0.1, 0.1}), {0.1, 0.2, -0.1});
  const PlaneView view = find(view_of(corner_of_a_room(), pose, 1));
  ASSERT_EQ(view.patches.size(), 3u);
  for (const TestPlane& plane : corner_of_a_room()) {
    const Eigen::Vector3d truth = over_distance_of(plane, pose);
    const PlanePatch& patch = nearest_patch(view, truth);
    EXPECT_LT(std::acos(patch.normal().dot(truth.normalized())), 0.003);
    EXPECT_NEAR(patch.distance(), 1 / truth.norm(), 0.003);
    EXPECT_NEAR(patch.over_distance.dot(patch.centre), 1, 1e-12);
  }
  // Most of the image shows them.
  const auto shown = std::count_if(view.patch_at.data(), view.patch_at.data() + view.patch_at.size(),
                                   [](uint8_t patch) { return patch > 0; });
  EXPECT_GT(shown, 0.7 * static_cast<double>(view.patch_at.size()));
}

TEST(PlaneFinder, ErrorsAreAsLargeAsTheCovarianceSays) {
  double sum = 0;
  int count = 0;
  PlaneFinder finder(plane_test_camera(), SensorNoise());
  for (uint64_t seed = 1; seed <= 40; ++seed) {
    const Rigid3 pose(rotation_from_vector({0.01 * static_cast<double>(seed), -0.1, 0}), {0, 0, 0});
    const PlaneView view = finder.find(view_of(corner_of_a_room(), pose, seed), {});
    for (const TestPlane& plane : corner_of_a_room()) {
      const Eigen::Vector3d truth = over_distance_of(plane, pose);
      const PlanePatch& patch = nearest_patch(view, truth);
      const Eigen::Vector3d error = patch.over_distance - truth;
      sum += error.dot(patch.covariance.inverse() * error);
      ++count;
    }
  }
  // Three degrees of freedom. Depths of a slanted block have one weight, so that they are not quite as good as said.
  EXPECT_GT(sum / count, 2);
  EXPECT_LT(sum / count, 6);
}

TEST(PlaneFinder, WavesOnAWallMakeItLessCertain) {
  const std::vector<TestPlane> wall = {{Eigen::Vector3d(0, 0, 1), 2.0}};
  DepthImage depth = view_of(wall, {}, 1);
  const double flat = find(depth).patches.front().covariance.trace();
  for (int y = 0; y < depth.height(); ++y)
    for (int x = 0; x < depth.width(); ++x) depth(x, y) += 0.006f * static_cast<float>(std::sin(0.05 * x));
  const PlaneView view = find(depth);
  ASSERT_EQ(view.patches.size(), 1u);
  EXPECT_GT(view.patches.front().covariance.trace(), 3 * flat);
}

TEST(PlaneFinder, ABallIsNotFlat) {
  const CameraModel camera = plane_test_camera();
  DepthImage depth(camera.width, camera.height);
  for (int y = 0; y < depth.height(); ++y)
    for (int x = 0; x < depth.width(); ++x) {
      // Of 0.4 m radius around a point 1 m away.
      const Eigen::Vector3d ray = camera.unproject(Eigen::Vector2d(x, y), 1);
      const double a = ray.squaredNorm(), b = ray.z(), discriminant = b * b - a * (1 - 0.4 * 0.4);
      if (discriminant > 0) depth(x, y) = static_cast<float>((b - std::sqrt(discriminant)) / a);
    }
  EXPECT_TRUE(find(depth).patches.empty());
}

TEST(PlaneFinder, NoDepthNoPlanes) {
  EXPECT_TRUE(find(DepthImage(320, 240)).patches.empty());
}

TEST(PlaneFinder, MoversAreNotLookedAt) {
  const std::vector<TestPlane> wall = {{Eigen::Vector3d(0, 0, 1), 2.0}};
  const CameraModel camera = plane_test_camera();
  MoverMask left{4, Image<uint8_t>(camera.width / 4, camera.height / 4)};
  for (int y = 0; y < left.cells.height(); ++y)
    for (int x = 0; x < left.cells.width() / 2; ++x) left.cells(x, y) = 1;
  const PlaneView view = PlaneFinder(camera, SensorNoise()).find(view_of(wall, {}, 1), left);
  ASSERT_EQ(view.patches.size(), 1u);
  EXPECT_GT(view.patches.front().centre.x(), 0.3);
  EXPECT_EQ(view.patch_at(2, 7), 0);
  EXPECT_EQ(view.patch_at(17, 7), 1);
}

TEST(PlaneFinder, PlanesAreThoseOfTheCameraAtTheImagesTime) {
  const Rigid3 later_from_earlier(rotation_from_vector({0.02, 0.05, -0.03}), {0.02, -0.01, 0.03});
  PlaneFinder finder(plane_test_camera(), SensorNoise());
  const PlaneView view = finder.find(view_of(corner_of_a_room(), {}, 1), {}, later_from_earlier);
  for (const TestPlane& plane : corner_of_a_room()) {
    const Eigen::Vector3d truth = over_distance_of(plane, later_from_earlier);
    const PlanePatch& patch = nearest_patch(view, truth);
    EXPECT_LT((patch.over_distance - truth).norm() / truth.norm(), 0.003);
    EXPECT_NEAR(patch.over_distance.dot(patch.centre), 1, 1e-12);
  }
}

TEST(PlaneFinder, ALensThatDistortsDoesNotBendThem) {
  CameraModel camera = plane_test_camera();
  camera.k1 = -0.3, camera.k2 = 0.1, camera.p1 = 0.002;
  const PlaneView view = find(view_of(corner_of_a_room(), {}, 1, camera), camera);
  ASSERT_EQ(view.patches.size(), 3u);
  for (const TestPlane& plane : corner_of_a_room()) {
    const Eigen::Vector3d truth = over_distance_of(plane, {});
    EXPECT_LT((nearest_patch(view, truth).over_distance - truth).norm() / truth.norm(), 0.003);
  }
}

}  // namespace
}  // namespace dkb
