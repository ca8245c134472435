// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/rgbd_features.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

CameraModel plain_camera() {
  CameraModel camera;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

RgbdImage image_of(const CameraModel& camera, float depth) {
  RgbdImage image;
  image.timestamp = image.depth_timestamp = 10;
  image.grey = GreyImage(camera.width, camera.height, 100);
  image.depth = DepthImage(camera.width, camera.height, depth);
  return image;
}

OrbFeatures corners_at(const std::vector<Eigen::Vector2f>& pixels) {
  OrbFeatures orb;
  for (const Eigen::Vector2f& p : pixels) {
    orb.corners.push_back({p.x(), p.y(), 0.5F, 30, 2});
    orb.descriptors.push_back({orb.corners.size(), 2, 3, 4});
  }
  return orb;
}

RgbdFeatures make(const OrbFeatures& orb, const RgbdImage& image, const CameraModel& camera,
                  const Vector6d& velocity = Vector6d::Zero(), const DepthOptions& options = {}) {
  return make_rgbd_features(orb.descriptors,
                            keypoints_as_seen(orb, image, UndistortionTable(camera), camera, SensorNoise()), image,
                            camera, SensorNoise(), velocity, options);
}

// Depth image of the plane normal * point = distance, given in the camera's axes.
DepthImage plane_depth(const CameraModel& camera, const Eigen::Vector3d& normal, double distance) {
  DepthImage depth(camera.width, camera.height);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      depth(x, y) = static_cast<float>(distance / normal.dot(camera.unproject({x, y}, 1.0)));
  return depth;
}

TEST(RgbdFeatures, CarryWhatExtractionFound) {
  const CameraModel camera = plain_camera();
  RgbdImage image = image_of(camera, 2);
  image.colour = ColourImage(camera.width, camera.height, {10, 20, 30});
  const RgbdFeatures f = make(corners_at({{100.25F, 50.5F}, {300, 200}}), image, camera);
  ASSERT_EQ(f.size(), 2U);
  EXPECT_EQ(f.descriptors[1], (Descriptor{2, 2, 3, 4}));
  const Keypoint& k = f.keypoints[0];
  EXPECT_EQ(k.pixel, Eigen::Vector2f(100.25F, 50.5F));
  EXPECT_EQ(k.image_pixel, k.pixel);
  EXPECT_EQ(k.depth, 2);
  EXPECT_EQ(k.angle, 0.5F);
  EXPECT_EQ(k.response, 30);
  EXPECT_EQ(k.octave, 2);
  EXPECT_EQ(k.colour, (Rgb{10, 20, 30}));
  int near = 0;
  f.grid.for_each_near({301, 199, 2}, [&](int i) { near += i == 1; });
  EXPECT_EQ(near, 1);
}

TEST(RgbdFeatures, GreyCamerasGiveGreyPoints) {
  const CameraModel camera = plain_camera();
  EXPECT_EQ(make(corners_at({{100, 50}}), image_of(camera, 2), camera).keypoints[0].colour, (Rgb{100, 100, 100}));
}

TEST(RgbdFeatures, DepthIsTheMedianOfTheNeighbours) {
  const CameraModel camera = plain_camera();
  RgbdImage image = image_of(camera, 2.0F);
  image.depth(100, 100) = 2.05F;  // 0.08 m may be on one surface
  image.depth(101, 100) = 1.99F;
  EXPECT_EQ(make(corners_at({{100, 100}}), image, camera).keypoints[0].depth, 2.0F);
  for (int dx : {-1, 0, 1})
    for (int dy : {-1, 1}) image.depth(100 + dx, 100 + dy) = 0;  // left: 2.0, 2.05, 1.99
  EXPECT_EQ(make(corners_at({{100.4F, 99.6F}}), image, camera).keypoints[0].depth, 2.0F);
  image.depth(99, 100) = 0;  // left: 2.05, 1.99
  EXPECT_FLOAT_EQ(make(corners_at({{100, 100}}), image, camera).keypoints[0].depth, 2.02F);
}

TEST(RgbdFeatures, NoDepthAtEdgesInHolesAtTheRimAndBeyondTheLimits) {
  const CameraModel camera = plain_camera();
  RgbdImage image = image_of(camera, 2.0F);
  image.depth(101, 101) = 2.11F;
  for (int y = 196; y <= 204; ++y)
    for (int x = 196; x <= 204; ++x) image.depth(x, y) = 0;
  const RgbdFeatures f = make(corners_at({{100, 100}, {200, 200}, {0, 100}, {639, 479}, {300, 300}}), image, camera);
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(f.keypoints[i].depth, 0) << i;
  EXPECT_EQ(f.keypoints[4].depth, 2);
  CameraModel short_sighted = camera;
  short_sighted.depth_max = 1.9;
  EXPECT_EQ(make(corners_at({{300, 300}}), image, short_sighted).keypoints[0].depth, 0);
  short_sighted.depth_max = 10;
  short_sighted.depth_min = 2.1;
  EXPECT_EQ(make(corners_at({{300, 300}}), image, short_sighted).keypoints[0].depth, 0);
}

// A plant's leaf: 2 m away, before a wall at 2.4 m; the depth image shows its left rim at x = 300.
TEST(RgbdFeatures, BesideAStepTheNearerSurfaceLendsItsDepth) {
  const CameraModel camera = plain_camera();
  RgbdImage image = image_of(camera, 2.4F);
  for (int y = 0; y < camera.height; ++y)
    for (int x = 300; x < camera.width; ++x) image.depth(x, y) = 2.0F;
  for (int y = 150; y < 170; ++y)
    for (int x = 296; x < 300; ++x) image.depth(x, y) = 0;  // the projector's shadow
  const RgbdFeatures f = make(
      corners_at({{298, 100}, {297, 160}, {300, 100}, {302, 100}, {295, 100}, {320, 100}, {290, 160}}), image, camera);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(f.keypoints[i].depth, 0) << i;
    EXPECT_EQ(f.keypoints[i].lent_depth, 2.0F) << i;
  }
  for (size_t i = 3; i < 7; ++i) {
    EXPECT_EQ(f.keypoints[i].depth, i == 3 || i == 5 ? 2.0F : 2.4F) << i;
    EXPECT_EQ(f.keypoints[i].lent_depth, 0) << i;
  }
  image.depth = DepthImage(camera.width, camera.height, 2.4F);
  image.depth(300, 100) = image.depth(301, 100) = 2.0F;  // two pixels are no surface
  EXPECT_EQ(make(corners_at({{298, 100}}), image, camera).keypoints[0].lent_depth, 0);
}

TEST(RgbdFeatures, ACornerShowsItsOwnSurfaceOrNothingNearerThanThoseAround) {
  const SensorNoise noise;  // three standard deviations at 2 m: 0.182 m
  Keypoint k;
  EXPECT_TRUE(may_show(k, 0.2, noise));
  k.lent_depth = 2;
  EXPECT_FALSE(may_show(k, 1.81, noise));
  EXPECT_TRUE(may_show(k, 1.83, noise));
  EXPECT_TRUE(may_show(k, 1.65, noise, 2));
  EXPECT_TRUE(may_show(k, 7.0, noise));
  k.lent_depth = 0;
  k.depth = 2;
  EXPECT_FALSE(may_show(k, 1.81, noise));
  EXPECT_TRUE(may_show(k, 1.83, noise));
  EXPECT_TRUE(may_show(k, 2.17, noise));
  EXPECT_FALSE(may_show(k, 2.19, noise));
}

// A floor that the camera looks along falls away fast, but is one surface.
TEST(RgbdFeatures, AFloorSeenAtAFlatAngleIsOneSurface) {
  const CameraModel camera = plain_camera();
  RgbdImage image = image_of(camera, 2);
  image.depth = plane_depth(camera, {0, 1, 0}, 1.0);
  for (int y = 400; y < 470; y += 10)  // 2.0 to 3.1 m
    EXPECT_NEAR(make(corners_at({{200, static_cast<float>(y)}}), image, camera).keypoints[0].depth, 500.0 / (y - 240),
                0.001)
        << y;
}

TEST(RgbdFeatures, UndistortionByTableIsThatOfTheCamera) {
  CameraModel camera = *builtin_camera("fr1");
  const UndistortionTable table(camera);
  Random random(3);
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector2d pixel{random.uniform(0, camera.width - 1), random.uniform(0, camera.height - 1)};
    const Eigen::Vector2f by_table = table(static_cast<float>(pixel.x()), static_cast<float>(pixel.y()));
    EXPECT_LT((by_table.cast<double>() - camera.undistort(pixel)).norm(), 0.05);
  }
  camera.k1 = -0.28, camera.k2 = 0.07, camera.k3 = 0;  // a wide lens: 25 px in the corners
  for (int i = 0; i < 500; ++i) {
    const Eigen::Vector2d pixel{random.uniform(0, camera.width - 1), random.uniform(0, camera.height - 1)};
    EXPECT_LT((camera.distort(camera.undistort(pixel)) - pixel).norm(), 0.01);
  }
  camera = *builtin_camera("fr1");
  const RgbdFeatures f = make(corners_at({{20, 30}}), image_of(camera, 2), camera);
  EXPECT_EQ(f.keypoints[0].image_pixel, Eigen::Vector2f(20, 30));
  EXPECT_EQ(f.keypoints[0].pixel, table(20, 30));
}

// A wall seen while the camera moves. The depth image was taken 10 ms earlier; the depths asked for are those at the
// colour image's time.
TEST(RgbdFeatures, DepthsAreCarriedToTheColourImagesTime) {
  const CameraModel camera = plain_camera();
  Vector6d velocity;  // now_cam_from_before_cam per second
  velocity << 0.8, -0.3, -1.2, 0.4, 0.9, -0.5;
  RgbdImage image = image_of(camera, 0);
  image.depth_timestamp = image.timestamp - 0.010;
  const Eigen::Vector3d normal_then = Eigen::Vector3d(0.3, -0.2, 1).normalized();
  const double distance_then = 2;
  image.depth = plane_depth(camera, normal_then, distance_then);
  // The same wall in the later camera: normal' = R n, distance' = distance + normal' * t.
  const Rigid3 now_from_then = rigid3_from_tangent(velocity * 0.010);
  const Eigen::Vector3d normal_now = now_from_then.rotation * normal_then;
  const DepthImage truth = plane_depth(camera, normal_now, distance_then + normal_now.dot(now_from_then.translation));

  Random random(1);
  std::vector<Eigen::Vector2f> pixels;
  for (int i = 0; i < 200; ++i)
    pixels.push_back({static_cast<float>(30 + random.below(580)), static_cast<float>(30 + random.below(420))});
  const RgbdFeatures corrected = make(corners_at(pixels), image, camera, velocity);
  // Or its stamp says later, by what the camera's file tells.
  CameraModel late = camera;
  late.depth_time_offset = -0.025;
  RgbdImage stamped = image;
  stamped.depth_timestamp = image.timestamp + 0.015;
  const RgbdFeatures by_offset = make(corners_at(pixels), stamped, late, velocity);
  DepthOptions off;
  off.model_time_offset = false;
  const RgbdFeatures plain = make(corners_at(pixels), image, camera, velocity, off);
  double error = 0, error_off = 0;
  for (size_t i = 0; i < pixels.size(); ++i) {
    const float z = truth(static_cast<int>(pixels[i].x()), static_cast<int>(pixels[i].y()));
    ASSERT_GT(corrected.keypoints[i].depth, 0);
    error = std::max(error, static_cast<double>(std::abs(corrected.keypoints[i].depth - z)));
    EXPECT_NEAR(by_offset.keypoints[i].depth, corrected.keypoints[i].depth, 1e-5);
    error_off += std::abs(plain.keypoints[i].depth - z) / static_cast<double>(pixels.size());
  }
  EXPECT_LT(error, 0.002);      // what rounding to whole pixels costs on the slanted wall
  EXPECT_GT(error_off, 0.004);  // on average; 1.2 m/s along the axis over 10 ms are 12 mm
}

TEST(RgbdFeatures, ACameraAtRestOrWithEqualStampsChangesNoDepth) {
  const CameraModel camera = plain_camera();
  RgbdImage image = image_of(camera, 0);
  image.depth = plane_depth(camera, Eigen::Vector3d(0.3, -0.2, 1).normalized(), 2);
  const OrbFeatures orb = corners_at({{100, 100}, {400, 300}});
  const RgbdFeatures at_rest = make(orb, image, camera);
  Vector6d velocity;
  velocity << 0.8, -0.3, -1.2, 0.4, 0.9, -0.5;
  EXPECT_EQ(make(orb, image, camera, velocity).keypoints[1].depth, at_rest.keypoints[1].depth);
  image.depth_timestamp -= 0.01;
  EXPECT_EQ(make(orb, image, camera).keypoints[1].depth, at_rest.keypoints[1].depth);
}

// Each row of a rolling shutter sees the scene from where the camera is at that row's time. With the true velocity the
// features return to where the camera in the middle of the exposure sees them.
class UndoneShutter : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(RgbdFeatures, UndoneShutter, testing::Values(0.030, -0.030));  // [s], -: upside down

TEST_P(UndoneShutter, IsExact) {
  CameraModel camera = plain_camera();
  camera.readout = GetParam();
  Vector6d velocity;
  velocity << 0.5, 0.2, -0.4, 0.3, -0.8, 0.6;
  Random random(5);
  double moved = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d point =
        camera.unproject({random.uniform(60, 580), random.uniform(60, 420)}, random.uniform(1, 3));
    const Eigen::Vector2d middle = camera.project(point);
    // The row that sees it: its time depends on where the point lies then, and that on the time.
    Eigen::Vector2d seen = middle;
    Eigen::Vector3d then = point;
    for (int k = 0; k < 10; ++k) {
      const double time = (seen.y() / camera.height - 0.5) * camera.readout;  // [s] after the middle
      then = rigid3_from_tangent(velocity * time) * point;
      seen = camera.project(then);
    }
    moved = std::max(moved, (seen - middle).norm());
    const RgbdImage image = image_of(camera, static_cast<float>(then.z()));
    const RgbdFeatures f = make(corners_at({seen.cast<float>()}), image, camera, velocity);
    EXPECT_LT((f.keypoints[0].pixel.cast<double>() - middle).norm(), 0.05);
    EXPECT_NEAR(f.keypoints[0].depth, point.z(), 0.0005);
    EXPECT_EQ(f.keypoints[0].image_pixel, seen.cast<float>());

    DepthOptions off;
    off.model_rolling_shutter = false;
    EXPECT_EQ(make(corners_at({seen.cast<float>()}), image, camera, velocity, off).keypoints[0].pixel,
              seen.cast<float>());
  }
  EXPECT_GT(moved, 5.0);  // [px] it was worth doing
}

TEST(RgbdFeatures, WithoutDepthTheTurnAloneIsUndone) {
  CameraModel camera = plain_camera();
  camera.readout = 0.030;
  Vector6d turning = Vector6d::Zero(), sliding = Vector6d::Zero();
  turning[4] = 1.0;
  sliding[0] = 1.0;
  const OrbFeatures top = corners_at({{320, 0}});  // exposed 15 ms before the middle
  const RgbdImage dark = image_of(camera, 0);
  // The ray turns by 0.015 rad in these 15 ms: at this height x moves by 500 * 0.015 * 1 = 7.5 px.
  EXPECT_NEAR(make(top, dark, camera, turning).keypoints[0].pixel.x(), 327.5, 0.05);
  EXPECT_EQ(make(top, dark, camera, sliding).keypoints[0].pixel.x(), 320);
}

TEST(RgbdFeatures, NoReadoutAndNoVelocityMeanNoChange) {
  CameraModel camera = plain_camera();
  Vector6d velocity;
  velocity << 0.5, 0.2, -0.4, 0.3, -0.8, 0.6;
  const OrbFeatures orb = corners_at({{100.3F, 20.7F}, {500.1F, 400.9F}});
  const RgbdImage image = image_of(camera, 2);
  const RgbdFeatures global = make(orb, image, camera, velocity);
  camera.readout = 0.030;
  const RgbdFeatures at_rest = make(orb, image, camera);
  for (size_t i = 0; i < 2; ++i)
    for (const RgbdFeatures* f : {&global, &at_rest}) {
      EXPECT_EQ(f->keypoints[i].pixel, f->keypoints[i].image_pixel);
      EXPECT_EQ(f->keypoints[i].depth, 2);
    }
  EXPECT_NE(make(orb, image, camera, velocity).keypoints[0].pixel, global.keypoints[0].pixel);
}

TEST(RgbdFeatures, ASubsetIsFoundWhereItLies) {
  const CameraModel camera = plain_camera();
  const RgbdFeatures all = make(corners_at({{100, 50}, {300, 200}, {500, 400}}), image_of(camera, 2), camera);
  const RgbdFeatures some = subset(all, {2, 0});
  ASSERT_EQ(some.size(), 2U);
  EXPECT_EQ(some.descriptors[0], all.descriptors[2]);
  std::vector<int> near;
  some.grid.for_each_near({499, 401, 3}, [&](int i) { near.push_back(i); });
  EXPECT_EQ(near, std::vector<int>{0});
}

TEST(RgbdFeatures, NothingFoundIsNoError) {
  const CameraModel camera = plain_camera();
  const RgbdFeatures f = make({}, image_of(camera, 2), camera);
  EXPECT_EQ(f.size(), 0U);
  f.grid.for_each_near({100, 100, 50}, [](int) { FAIL(); });
}

}  // namespace
}  // namespace dkb
