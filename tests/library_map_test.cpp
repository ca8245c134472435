// SPDX-License-Identifier: Apache-2.0
// Maps on disk, as users of the library save and load them.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

#include "library_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

TEST_F(Library, AMapIsSavedAndLoaded) {
  Slam first = slam_with();
  feed(first, world.walk(0, 15));
  first.finish();
  first.save_map(folder / "a.dkb");
  Slam second = slam_with();
  feed(second, world.walk(40, 50));  // somewhere else, and later
  second.load_map(folder / "a.dkb");
  EXPECT_EQ(second.map().point_count(), first.map().point_count());
  EXPECT_EQ(second.statistics().frames, 0);
  EXPECT_TRUE(second.trajectory().empty());
  for (const KeyframeInfo& k : second.map().keyframes()) EXPECT_LT(k.frame, 0);
  EXPECT_FALSE(second.process(world.frame(3, {.shift = 9})).tracked()) << "it is lost until it is found";
  FrameResult r = second.process(world.frame(4, {.shift = 10}));
  EXPECT_EQ(r.state, TrackingState::relocalised);
  EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(10), 5e-3) << "in the first one's world";
}

TEST_F(Library, AMapTaskWritesTheMapOfItsMoment) {
  Slam slam = slam_with(std::make_shared<EveryNth>(3));
  feed(slam, world.walk(0, 10));
  slam.finish();
  slam.save_map(folder / "now.dkb");
  const auto task = slam.save_map_task();
  feed(slam, world.walk(10, 30));
  slam.finish();
  slam.save_map(folder / "later.dkb");
  std::thread([&] { task(folder / "task.dkb"); }).join();
  const auto bytes = [&](const char* name) {
    std::ifstream file(folder / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_TRUE(bytes("task.dkb") == bytes("now.dkb"));
  EXPECT_FALSE(bytes("task.dkb") == bytes("later.dkb"));
}

// What is mapped becomes visible with the next frame's beginning, and in real time only if it is done by then.
TEST_F(Library, AMapSavedInRealTimeHoldsWhatShouldHaveBeenMappedByNow) {
  Options options;
  options.realtime = true;
  Slam slam = slam_with(nullptr, options);
  const std::string file = testing::TempDir() + "dkb_saved_in_real_time.dkb";
  for (const Frame& frame : world.walk(0, 4)) slam.process(frame);  // the first keyframe is due after 0.1 s
  EXPECT_EQ(slam.statistics().keyframes, 0);
  slam.save_map(file);
  EXPECT_EQ(slam.statistics().keyframes, 1);
  Slam other = slam_with();
  other.load_map(file);
  EXPECT_EQ(other.statistics().keyframes, 1);
  std::filesystem::remove(file);
}

// It would take the place of a good one, and nobody could load it.
TEST_F(Library, AnEmptyMapIsNotWritten) {
  Slam slam = slam_with();
  std::ofstream(folder / "a.dkb") << "of yesterday";
  for (const char* name : {"a.dkb", "new.dkb"}) {
    EXPECT_NE(error_of([&] { slam.save_map(folder / name); }).find("no keyframe yet"), std::string::npos);
    EXPECT_NE(error_of([&] { slam.save_map_task()(folder / name); }).find(name), std::string::npos);
  }
  EXPECT_EQ(fs::file_size(folder / "a.dkb"), 12U);
  EXPECT_FALSE(fs::exists(folder / "new.dkb"));
  feed(slam, world.walk(0, 8));
  slam.finish();
  EXPECT_EQ(error_of([&] { slam.save_map(""); }), "save_map: the path is empty; give the name of a file, as map.dkb");
  EXPECT_EQ(error_of([&] { slam.save_map(folder / "a.dkb"); }), "no error");
  EXPECT_GT(fs::file_size(folder / "a.dkb"), 1000U);
}

// The clock of the session that made the map may be another one.
TEST_F(Library, SecondsSinceAKeyframeOfALoadedMapCountFromWhenTheCameraWasFoundInIt) {
  struct Listening final : KeyframePolicy {
    KeyframeAnswer decide(const KeyframeQuery& q) override {
      asked.push_back(q);
      return {};
    }
    std::vector<KeyframeQuery> asked;
  };
  Slam first = slam_with();
  feed(first, world.walk(0, 15));
  first.finish();
  first.save_map(folder / "a.dkb");
  const auto rule = std::make_shared<Listening>();
  Slam second(world.camera(), Options(), Detectors::none(), rule);
  second.load_map(folder / "a.dkb");
  for (int i = 0; i < 3; ++i) second.process(world.frame(20 + i, {.shift = 9 + i}));
  ASSERT_EQ(rule->asked.size(), 2U) << "found in the second frame";
  const KeyframeQuery& q = rule->asked.front();
  const auto keyframes = second.map().keyframes();
  EXPECT_TRUE(std::any_of(keyframes.begin(), keyframes.end(),
                          [&q](const KeyframeInfo& k) { return q.frames_since_keyframe == q.frame - k.frame; }))
      << q.frames_since_keyframe << " frames";
  EXPECT_EQ(q.seconds_since_keyframe, 0);
  EXPECT_DOUBLE_EQ(rule->asked[1].seconds_since_keyframe,
                   1e-9 * static_cast<double>(rule->asked[1].stamp_ns - q.stamp_ns));
}

TEST_F(Library, AMapThatDoesNotFitLeavesAllAsItWas) {
  Camera other = world.camera();
  other.fx += 1;
  Slam elsewhere(other, Options(), Detectors::none());
  for (int i = 0; i < 8; ++i) {
    const Frame f = world.frame(i, {.shift = i});
    FrameInput input;
    input.stamp_ns = f.stamp_ns();
    input.colour = f.grey(), input.depth = f.depth();
    elsewhere.process(input);
  }
  elsewhere.finish();
  ASSERT_GT(elsewhere.map().point_count(), 100U);
  elsewhere.save_map(folder / "other.dkb");
  std::ofstream(folder / "broken.dkb") << "not a map";

  Slam slam = slam_with(), undisturbed = slam_with();
  const auto frames = world.walk(0, 16);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i == 8) {
      EXPECT_NE(error_of([&] { slam.load_map(folder / "other.dkb"); }).find("another camera"), std::string::npos);
      EXPECT_NE(error_of([&] { slam.load_map(folder / "broken.dkb"); }).find("broken.dkb"), std::string::npos);
      EXPECT_NE(error_of([&] { slam.load_map(folder / "none.dkb"); }).find("none.dkb"), std::string::npos);
      EXPECT_NE(error_of([&] { slam.save_map(folder / "no" / "folder.dkb"); }), "no error");
    }
    slam.process(frames[i]);
    undisturbed.process(frames[i]);
  }
  slam.finish();
  undisturbed.finish();
  EXPECT_EQ(bytes_of(slam), bytes_of(undisturbed));
}

}  // namespace
}  // namespace dkb::test
