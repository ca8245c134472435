// SPDX-License-Identifier: Apache-2.0
// The library's front door, on simulated frames.
#include "dkb_slam/slam.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <cstring>

#include "dkb/dataset/trajectory_file.h"
#include "dkb_slam/source.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

class SlamTest : public ::testing::Test {
 protected:
  SlamTest() {
    const auto source = open_folder(sequence());
    camera = source->camera();
    for (SourceFrame next = source->next(); next.state == SourceState::frame; next = source->next())
      frames.push_back(next.frame);
  }
  std::vector<FrameResult> feed(Slam& slam, size_t from, size_t to) const {
    std::vector<FrameResult> results;
    for (size_t i = from; i < to; ++i) results.push_back(slam.process(frames[i]));
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
  static void expect_same(const Slam& a, const Slam& b) {
    expect_same(a.trajectory(), b.trajectory());
    expect_same(a.online_trajectory(), b.online_trajectory());
    expect_same(a.keyframes(), b.keyframes());
    const auto points = a.map().points(), others = b.map().points();
    ASSERT_EQ(points.size(), others.size());
    for (size_t i = 0; i < points.size(); ++i) {
      ASSERT_EQ(points[i].id, others[i].id);
      ASSERT_EQ(points[i].position_in_world, others[i].position_in_world);
    }
  }

  Camera camera;
  std::vector<Frame> frames;
};

// Rows of the first frame are sheared by a turn that only the second frame tells.
TEST(SlamStart, AMapThatStartsInATurnIsNotSheared) {
  const TempFolder folder;
  const auto spin = simulated(folder / "spin", {"--scene", "spin", "--seed", "1", "--frames", "6", "--people", "0"});
  const auto source = open_folder(spin);
  Camera camera = source->camera();
  camera.readout = 0.018;  // the simulator's
  Slam slam(camera);
  for (SourceFrame next = source->next(); next.state == SourceState::frame; next = source->next())
    slam.process(next.frame);
  slam.finish();
  const auto truth = read_trajectory(spin / "groundtruth.txt");
  for (const auto& poses : {slam.online_trajectory(), slam.trajectory()}) {
    ASSERT_EQ(poses.size(), 6u);
    for (size_t i = 1; i < poses.size(); ++i) {
      const Rigid3 turned = poses[0].world_from_cam.inverse() * poses[i].world_from_cam;
      const Rigid3 turns = truth[0].world_from_cam.inverse() * truth[i].world_from_cam;
      EXPECT_GT(turns.rotation.angularDistance(Eigen::Quaterniond::Identity()), 0.04 * static_cast<double>(i));
      EXPECT_LT(turned.rotation.angularDistance(turns.rotation), 0.005) << "frame " << i;  // 0.037 as it was seen
    }
  }
}

TEST_F(SlamTest, ThreadsDoNotChangeABit) {
  Options one_thread;
  one_thread.threaded = false;
  Slam with(camera), without(camera, one_thread);
  feed(with, 0, frames.size());
  feed(without, 0, frames.size());
  expect_same(with, without);  // also while mapping is at work
  with.finish();
  without.finish();
  expect_same(with, without);
}

TEST_F(SlamTest, InstancesDoNotKnowOfEachOther) {
  Slam alone(camera), first(camera), second(camera);
  feed(alone, 0, 25);
  for (size_t i = 0; i < 25; ++i) {
    first.process(frames[i]);
    if (i % 2 == 0) second.process(frames[i]);
  }
  alone.finish();
  first.finish();
  expect_same(alone, first);
}

TEST_F(SlamTest, AfterAResetTheWorldBeginsAnew) {
  Slam used(camera), fresh(camera);
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

TEST_F(SlamTest, ImagesOfAnotherSizeAreRefusedAndHarmNothing) {
  Slam slam(camera), undisturbed(camera);
  feed(slam, 0, 5);
  FrameInput input{frames[5].stamp_ns(), frames[5].colour(), frames[5].depth(), {}, {}};
  input.colour.height /= 2;
  EXPECT_THROW(slam.process(input), InputError);
  input.colour = frames[5].colour();
  input.depth.width /= 2;
  EXPECT_THROW(slam.process(input), InputError);
  Camera half = camera;
  half.width /= 2, half.height /= 2;
  input.colour.width = input.depth.width = half.width;
  input.colour.height = input.depth.height = half.height;
  EXPECT_THROW(slam.process(Frame(half, input)), InputError) << "a frame that was made for another camera";
  EXPECT_THROW(slam.process(Frame()), InputError) << "and one without images";
  feed(slam, 5, 12);
  feed(undisturbed, 0, 12);
  slam.finish();
  undisturbed.finish();
  expect_same(slam, undisturbed);
}

TEST_F(SlamTest, StampsMustRise) {
  Slam slam(camera);
  feed(slam, 0, 3);
  EXPECT_THROW(slam.process(frames[2]), InputError);
  EXPECT_THROW(slam.process(frames[0]), InputError);
  EXPECT_TRUE(slam.process(frames[3]).tracked());
}

TEST_F(SlamTest, ACameraThatCannotBeIsRefused) {
  Camera wrong = camera;
  wrong.width = -1;
  EXPECT_THROW(Slam slam(wrong), InvalidOption);
  wrong.k1 = 0.1;
  EXPECT_THROW(Slam slam(wrong), InvalidOption) << "distorted";
  Options options;
  EXPECT_THROW(options.set("features.count", "-5"), InvalidOption);
  options.features.count = -5;
  EXPECT_THROW(Slam slam(camera, options), InvalidOption);
}

TEST_F(SlamTest, LocaliseOnlyLeavesTheMapAlone) {
  Slam slam(camera);
  feed(slam, 0, 15);
  slam.finish();
  const auto keyframes = slam.keyframes();
  const size_t points = slam.map().point_count();
  slam.localize_only(true);
  for (const FrameResult& r : feed(slam, 15, 30)) {
    EXPECT_TRUE(r.tracked());
    EXPECT_FALSE(r.keyframe);
  }
  slam.finish();
  expect_same(slam.keyframes(), keyframes);
  EXPECT_EQ(slam.map().point_count(), points);
}

TEST_F(SlamTest, AMountedCameraGivesTheSamePathFromTheBase) {
  Options mounted;  // looking along the base's x axis, half a metre up
  mounted.base_from_cam.rotation = Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5);
  mounted.base_from_cam.translation = {0.1, 0, 0.5};
  Slam plain(camera), based(camera, mounted);
  const auto a = feed(plain, 0, 25), b = feed(based, 0, 25);
  for (size_t i = 0; i < a.size(); ++i) {
    ASSERT_TRUE(b[i].tracked()) << "frame " << i;
    const Rigid3 expected = mounted.base_from_cam * *a[i].world_from_cam;
    EXPECT_LT((expected.translation - b[i].world_from_cam->translation).norm(), 0.005) << "frame " << i;
    EXPECT_LT(expected.rotation.angularDistance(b[i].world_from_cam->rotation), 0.005) << "frame " << i;
  }
  EXPECT_LT(b[0].world_from_odom.translation.norm(), 1e-9);
  EXPECT_LT(b[5].world_from_odom.translation.norm(), 0.01) << "the world is not moved by mapping's first word";
}

TEST_F(SlamTest, OdometryTakesNoJumpsAndTheWorldTakesThemAll) {
  const Trajectory truth = read_trajectory(sequence() / "groundtruth.txt");
  Slam slam(camera);
  const auto results = feed(slam, 0, frames.size());
  for (size_t i = 0; i < results.size(); ++i) {
    const FrameResult& r = results[i];
    ASSERT_TRUE(r.tracked());
    const Rigid3 composed = r.world_from_odom * *r.odom_from_cam;
    EXPECT_LT((composed.translation - r.world_from_cam->translation).norm(), 1e-9);
    if (i == 0) continue;
    const Rigid3 step = results[i - 1].odom_from_cam->inverse() * *r.odom_from_cam;
    const Rigid3 true_step = truth[i - 1].world_from_cam.inverse() * truth[i].world_from_cam;
    EXPECT_LT((step.translation - true_step.translation).norm(), 0.006) << "frame " << i;
  }
}

TEST_F(SlamTest, TheFinalPosesSmoothEachOther) {
  const Trajectory truth = read_trajectory(sequence() / "groundtruth.txt");
  Options raw;
  raw.set("experiment.smooth_trajectory", "false");
  Slam slam(camera), without(camera, raw);
  for (Slam* s : {&slam, &without}) {
    feed(*s, 0, frames.size());
    s->finish();
  }
  expect_same(slam.keyframes(), without.keyframes());
  expect_same(slam.online_trajectory(), without.online_trajectory());
  const auto step_errors = [&](const Slam& s) {
    const auto poses = s.trajectory();
    double sum = 0;
    for (size_t i = 1; i < poses.size(); ++i) {
      const Rigid3 step = poses[i - 1].world_from_cam.inverse() * poses[i].world_from_cam;
      const Rigid3 true_step = truth[i - 1].world_from_cam.inverse() * truth[i].world_from_cam;
      sum += (step.translation - true_step.translation).squaredNorm();
    }
    return std::sqrt(sum / static_cast<double>(poses.size() - 1));
  };
  ASSERT_EQ(slam.trajectory().size(), truth.size());
  EXPECT_LT(step_errors(slam), 0.9 * step_errors(without)) << step_errors(without);
}

TEST_F(SlamTest, TheCovarianceIsOneAndSpeaksOfMillimetres) {
  Slam slam(camera);
  for (const FrameResult& r : feed(slam, 0, 20)) {
    if (r.frame == 0) continue;
    EXPECT_LT((*r.covariance - r.covariance->transpose()).norm(), 1e-12);
    const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(*r.covariance);
    EXPECT_GT(eigen.eigenvalues().minCoeff(), 0);
    EXPECT_LT(std::sqrt(r.covariance->topLeftCorner<3, 3>().trace()), 0.02) << "[m]";
    EXPECT_LT(std::sqrt(r.covariance->bottomRightCorner<3, 3>().trace()), 0.02) << "[rad]";
  }
}

TEST_F(SlamTest, AMapThatHangsOnAGuessIsAsUncertainAsTheGuess) {
  // Nothing of the first image is seen again: the map begins anew, hung on the first frame by a camera of unknown
  // speed.
  const TempFolder folder;
  const auto other =
      open_folder(simulated(folder / "other", {"--scene", "room", "--people", "0", "--seed", "9", "--frames", "1"}));
  const SourceFrame strange = other->next();
  Options options;
  options.dynamics.filter = FilterKind::none;  // no depth is compared that would tell the step
  Slam slam(camera, options);
  slam.process({frames[0].stamp_ns(), strange.frame.colour(), strange.frame.depth(), {}, {}});
  std::vector<FrameResult> results = feed(slam, 1, 20);
  ASSERT_TRUE(results.back().tracked());
  slam.finish();
  const auto sd = [](const FrameResult& r) { return std::sqrt(r.covariance->topLeftCorner<3, 3>().trace()); };
  EXPECT_GT(sd(results.front()), 0.005) << "[m]";
  EXPECT_GT(sd(results.back()), 0.005) << "[m]";
}

TEST_F(SlamTest, RawBuffersAreTheSameImages) {
  Slam by_frame(camera), by_buffer(camera);
  for (size_t i = 0; i < 10; ++i) {
    const ImageView rgb = frames[i].colour(), metres = frames[i].depth();
    std::vector<uint8_t> bgra;
    std::vector<uint16_t> depth;
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const uint8_t* pixel = rgb.row(y) + 3 * x;
        bgra.insert(bgra.end(), {pixel[2], pixel[1], pixel[0], 255});
        float z = 0;
        std::memcpy(&z, metres.row(y) + 4 * x, sizeof z);
        depth.push_back(static_cast<uint16_t>(std::lround(z * camera.depth_factor)));
      }
    by_frame.process(frames[i]);
    FrameInput input;
    input.stamp_ns = frames[i].stamp_ns();
    input.colour = {bgra.data(), camera.width, camera.height, 0, PixelFormat::bgra8};
    input.depth = {depth.data(), camera.width, camera.height, 0, PixelFormat::depth_u16};
    input.depth_stamp_ns = frames[i].depth_stamp_ns();
    by_buffer.process(input);
  }
  by_frame.finish();
  by_buffer.finish();
  ASSERT_EQ(by_frame.statistics().tracked, 10);
  expect_same(by_frame, by_buffer);
  EXPECT_THROW(by_buffer.process(FrameInput()), InputError);
}

TEST_F(SlamTest, StatisticsAndFeaturesTellWhatHappened) {
  Slam slam(camera);
  int keyframes = 0;
  const auto results = feed(slam, 0, 20);
  for (const FrameResult& r : results) {
    keyframes += r.keyframe;
    EXPECT_GE(r.reference_keyframe, 0);
  }
  int used = 0;
  for (const FeatureReport& f : results.back().features) {
    used += f.state == FeatureState::used;
    EXPECT_NE(f.state, FeatureState::dynamic);
    EXPECT_TRUE(f.image_x >= 0 && f.image_y >= 0 && f.image_x < 640 && f.image_y < 480);
  }
  EXPECT_GT(used, 100);
  slam.finish();
  const Statistics s = slam.statistics();
  EXPECT_EQ(s.frames, 20);
  EXPECT_EQ(s.tracked, 20);
  EXPECT_EQ(s.keyframes_inserted, keyframes);
  EXPECT_EQ(s.keyframes, keyframes - s.keyframes_culled);
  EXPECT_EQ(s.keyframes, static_cast<int>(slam.keyframes().size()));
  EXPECT_EQ(s.map_points, slam.map().point_count());
  EXPECT_EQ(s.stages.at("tracking").count, 20U);
  EXPECT_EQ(s.stages.at("mapping").count, static_cast<size_t>(keyframes));
}

TEST_F(SlamTest, FinishingMayHappenAtAnyFrame) {
  for (size_t last = 1; last <= 12; ++last) {
    Slam slam(camera);
    int keyframes = 0;
    for (const FrameResult& r : feed(slam, 0, last)) keyframes += r.keyframe;
    slam.finish();
    const Statistics s = slam.statistics();
    EXPECT_EQ(s.stages.at("mapping").count, static_cast<size_t>(keyframes)) << "after frame " << last;
    EXPECT_TRUE(slam.process(frames[last]).tracked());
  }
}

TEST_F(SlamTest, EndsCleanlyWithWorkOutstanding) {
  Slam slam(camera);
  feed(slam, 0, 2);
}

}  // namespace
}  // namespace dkb::test
