// SPDX-License-Identifier: Apache-2.0
// The library's front door, on simulated frames.
#include "dkb/slam/slam_system.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/rgbd_reader.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/util/errors.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

using Images = std::vector<std::shared_ptr<const RgbdImage>>;

class SlamSystemTest : public ::testing::Test {
 protected:
  SlamSystemTest() : camera(Camera::load(sequence() / "camera.yaml")) {
    RgbdReader reader(open_tum_dataset(sequence()).pairs, camera, {}, nullptr);
    while (const auto frame = reader.next()) images.push_back(frame->image);
  }
  std::vector<FrameResult> feed(SlamSystem& slam, size_t from, size_t to) const {
    std::vector<FrameResult> results;
    for (size_t i = from; i < to; ++i) results.push_back(slam.process(images[i]));
    return results;
  }
  static void expect_same(const std::vector<TrajectoryFrame>& a, const std::vector<TrajectoryFrame>& b) {
    ASSERT_EQ(a.size(), b.size());
    for (size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(a[i].frame, b[i].frame);
      ASSERT_EQ(a[i].world_from_cam.translation, b[i].world_from_cam.translation) << "frame " << a[i].frame;
      ASSERT_EQ(a[i].world_from_cam.rotation.coeffs(), b[i].world_from_cam.rotation.coeffs()) << "frame " << a[i].frame;
    }
  }
  static void expect_same(const SlamSystem& a, const SlamSystem& b) {
    expect_same(a.trajectory(), b.trajectory());
    expect_same(a.online_trajectory(), b.online_trajectory());
    expect_same(a.keyframes(), b.keyframes());
    const auto points = a.map()->live_points();
    ASSERT_EQ(points, b.map()->live_points());
    for (PointId p : points) ASSERT_EQ(a.map()->point(p)->position, b.map()->point(p)->position);
  }

  CameraModel camera;
  Images images;
};

TEST_F(SlamSystemTest, ThreadsDoNotChangeABit) {
  SlamOptions one_thread;
  one_thread.pipeline.threaded = false;
  SlamSystem with(camera), without(camera, one_thread);
  feed(with, 0, images.size());
  feed(without, 0, images.size());
  expect_same(with, without);  // also while mapping is at work
  with.finish();
  without.finish();
  expect_same(with, without);
}

TEST_F(SlamSystemTest, InstancesDoNotKnowOfEachOther) {
  SlamSystem alone(camera), first(camera), second(camera);
  feed(alone, 0, 25);
  for (size_t i = 0; i < 25; ++i) {
    first.process(images[i]);
    if (i % 2 == 0) second.process(images[i]);
  }
  alone.finish();
  first.finish();
  expect_same(alone, first);
}

TEST_F(SlamSystemTest, AfterAResetTheWorldBeginsAnew) {
  SlamSystem used(camera), fresh(camera);
  feed(used, 10, 25);
  used.reset();
  EXPECT_EQ(used.statistics().frames, 0);
  EXPECT_TRUE(used.trajectory().empty());
  const auto results = feed(used, 0, 20);  // earlier stamps than before
  EXPECT_TRUE(results.front().keyframe);
  EXPECT_EQ(results.front().frame, 0);
  feed(fresh, 0, 20);
  used.finish();
  fresh.finish();
  expect_same(used, fresh);
}

TEST_F(SlamSystemTest, ImagesOfAnotherSizeAreRefusedAndHarmNothing) {
  SlamSystem slam(camera), undisturbed(camera);
  feed(slam, 0, 5);
  auto small = std::make_shared<RgbdImage>(*images[5]);
  small->grey = GreyImage(320, 240);
  EXPECT_THROW(slam.process(small), InputError);
  auto shallow = std::make_shared<RgbdImage>(*images[5]);
  shallow->depth = DepthImage(320, 240);
  EXPECT_THROW(slam.process(shallow), InputError);
  feed(slam, 5, 12);
  feed(undisturbed, 0, 12);
  slam.finish();
  undisturbed.finish();
  expect_same(slam, undisturbed);
}

TEST_F(SlamSystemTest, StampsMustRise) {
  SlamSystem slam(camera);
  feed(slam, 0, 3);
  EXPECT_THROW(slam.process(images[2]), InputError);
  EXPECT_THROW(slam.process(images[0]), InputError);
  auto never = std::make_shared<RgbdImage>(*images[3]);
  never->timestamp = std::nan("");
  EXPECT_THROW(slam.process(never), InputError);
  EXPECT_TRUE(slam.process(images[3]).tracked());
}

TEST_F(SlamSystemTest, ACameraThatCannotBeIsRefused) {
  CameraModel wrong = camera;
  wrong.width = -1;
  EXPECT_THROW(SlamSystem slam(wrong), InvalidOption);
  wrong.k1 = 0.1;
  EXPECT_THROW(SlamSystem slam(wrong), InvalidOption) << "distorted";
  SlamOptions options;
  options.features.count = -5;
  EXPECT_THROW(SlamSystem slam(camera, options), InvalidOption);
}

TEST_F(SlamSystemTest, LocaliseOnlyLeavesTheMapAlone) {
  SlamSystem slam(camera);
  feed(slam, 0, 15);
  slam.finish();
  const auto keyframes = slam.keyframes();
  const size_t points = slam.map()->point_count();
  slam.set_localise_only(true);
  for (const FrameResult& r : feed(slam, 15, 30)) {
    EXPECT_TRUE(r.tracked());
    EXPECT_FALSE(r.keyframe);
  }
  slam.finish();
  expect_same(slam.keyframes(), keyframes);
  EXPECT_EQ(slam.map()->point_count(), points);
}

TEST_F(SlamSystemTest, AMountedCameraGivesTheSamePathFromTheBase) {
  SlamOptions mounted;  // looking along the base's x axis, half a metre up
  mounted.base_from_cam.rotation = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
  mounted.base_from_cam.translation = {0.1, 0, 0.5};
  SlamSystem plain(camera), based(camera, mounted);
  const auto a = feed(plain, 0, 25), b = feed(based, 0, 25);
  for (size_t i = 0; i < a.size(); ++i) {
    ASSERT_TRUE(b[i].tracked()) << "frame " << i;
    const Rigid3 expected = mounted.base_from_cam * a[i].world_from_cam;
    EXPECT_LT((expected.translation - b[i].world_from_cam.translation).norm(), 0.005) << "frame " << i;
    EXPECT_LT(expected.rotation.angularDistance(b[i].world_from_cam.rotation), 0.005) << "frame " << i;
  }
  EXPECT_LT(b[0].world_from_odom.translation.norm(), 1e-9);
  EXPECT_LT(b[5].world_from_odom.translation.norm(), 0.01) << "the world is not moved by mapping's first word";
}

TEST_F(SlamSystemTest, OdometryTakesNoJumpsAndTheWorldTakesThemAll) {
  const Trajectory truth = read_trajectory(sequence() / "groundtruth.txt");
  SlamSystem slam(camera);
  const auto results = feed(slam, 0, images.size());
  for (size_t i = 0; i < results.size(); ++i) {
    const FrameResult& r = results[i];
    ASSERT_TRUE(r.tracked());
    const Rigid3 composed = r.world_from_odom * r.odom_from_cam;
    EXPECT_LT((composed.translation - r.world_from_cam.translation).norm(), 1e-9);
    if (i == 0) continue;
    const Rigid3 step = results[i - 1].odom_from_cam.inverse() * r.odom_from_cam;
    const Rigid3 true_step = truth[i - 1].world_from_cam.inverse() * truth[i].world_from_cam;
    EXPECT_LT((step.translation - true_step.translation).norm(), 0.006) << "frame " << i;
  }
}

TEST_F(SlamSystemTest, TheCovarianceIsOneAndSpeaksOfMillimetres) {
  SlamSystem slam(camera);
  for (const FrameResult& r : feed(slam, 0, 20)) {
    if (r.frame == 0) continue;
    EXPECT_LT((r.covariance - r.covariance.transpose()).norm(), 1e-12);
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(r.covariance);
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0);
    EXPECT_LT(std::sqrt(r.covariance.topLeftCorner<3, 3>().trace()), 0.02) << "[m]";
    EXPECT_LT(std::sqrt(r.covariance.bottomRightCorner<3, 3>().trace()), 0.02) << "[rad]";
  }
}

TEST_F(SlamSystemTest, RawBuffersAreTheSameImages) {
  SlamSystem by_image(camera), by_buffer(camera);
  for (size_t i = 0; i < 10; ++i) {
    auto image = std::make_shared<RgbdImage>(*images[i]);
    image->depth_timestamp = image->timestamp;
    std::vector<uint8_t> rgb;
    for (size_t p = 0; p < image->colour.size(); ++p)
      for (uint8_t c : {image->colour.data()[p].r, image->colour.data()[p].g, image->colour.data()[p].b})
        rgb.push_back(c);
    std::vector<uint16_t> depth;
    for (size_t p = 0; p < image->depth.size(); ++p)
      depth.push_back(static_cast<uint16_t>(std::lround(image->depth.data()[p] * camera.depth_factor)));
    const FrameResult a = by_image.process(image);
    const FrameResult b = by_buffer.process(image->timestamp, rgb.data(), 3, depth.data());
    ASSERT_TRUE(a.tracked() && b.tracked());
    EXPECT_LT((a.world_from_cam.translation - b.world_from_cam.translation).norm(), 1e-3);
  }
  EXPECT_THROW(by_buffer.process(1e10, nullptr, 2, nullptr), InputError);
}

TEST_F(SlamSystemTest, StatisticsAndFeaturesTellWhatHappened) {
  SlamSystem slam(camera);
  int keyframes = 0;
  for (const FrameResult& r : feed(slam, 0, 20)) {
    keyframes += r.keyframe;
    EXPECT_GE(r.reference, 0);
  }
  int used = 0;
  for (const FeatureReport& f : slam.features()) {
    used += f.state == FeatureState::used;
    EXPECT_NE(f.state, FeatureState::dynamic);
    EXPECT_TRUE(f.image_x >= 0 && f.image_y >= 0 && f.image_x < 640 && f.image_y < 480);
  }
  EXPECT_GT(used, 100);
  slam.finish();
  const SlamStatistics s = slam.statistics();
  EXPECT_EQ(s.frames, 20);
  EXPECT_EQ(s.tracked, 20);
  EXPECT_EQ(s.keyframes_inserted, keyframes);
  EXPECT_EQ(s.keyframes, keyframes - s.mapping.keyframes_culled);
  EXPECT_EQ(s.keyframes, static_cast<int>(slam.keyframes().size()));
  EXPECT_EQ(s.map_points, slam.map()->point_count());
  EXPECT_EQ(s.stages.at("tracking").count, 20U);
  EXPECT_EQ(s.stages.at("mapping").count, static_cast<size_t>(keyframes));
}

TEST_F(SlamSystemTest, FinishingMayHappenAtAnyFrame) {
  for (size_t last = 1; last <= 12; ++last) {
    SlamSystem slam(camera);
    int keyframes = 0;
    for (const FrameResult& r : feed(slam, 0, last)) keyframes += r.keyframe;
    slam.finish();
    const SlamStatistics s = slam.statistics();
    EXPECT_EQ(s.stages.at("mapping").count, static_cast<size_t>(keyframes)) << "after frame " << last;
    EXPECT_TRUE(slam.process(images[last]).tracked());
  }
}

TEST_F(SlamSystemTest, EndsCleanlyWithWorkOutstanding) {
  SlamSystem slam(camera);
  feed(slam, 0, 2);
}

}  // namespace
}  // namespace dkb::test
