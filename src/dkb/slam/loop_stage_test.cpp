// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/loop_stage.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/loop/loop_test_world.h"

namespace dkb {
namespace {

LoopStageOptions prompt() {
  LoopStageOptions options;
  options.loop_latency = {3.0 / 30, 0.1 / 30};
  options.global_ba_latency = {5.0 / 30, 0.1 / 30};
  return options;
}

TEST(BackgroundLatency, GrowsWithTheMapInWholeFramesOfTheCamera) {
  const BackgroundLatency latency{1.0 / 3, 0.02 / 30};  // [s] ten frames of 30 Hz, and one for 50 keyframes
  const FrameRate fast(30), slow(10);
  EXPECT_EQ(fast.frames(latency(0)), 10);
  EXPECT_EQ(fast.frames(latency(1)), 11);
  EXPECT_EQ(fast.frames(latency(50)), 11);
  EXPECT_EQ(fast.frames(latency(2000)), 50);
  EXPECT_EQ(slow.frames(latency(0)), 4);
  EXPECT_EQ(slow.frames(latency(2000)), 17);
}

TEST(FrameRate, IsTheCamerasOrWhatTheFirstFiveStampsSay) {
  FrameRate known(60), unknown(0);
  const int64_t stamps[] = {0, 100'000'000, 205'000'000, 300'000'000, 700'000'000, 710'000'000};
  for (int64_t stamp : stamps) {
    EXPECT_EQ(unknown.frames(1), stamp <= 700'000'000 ? 30 : 10);
    known.add(stamp);
    unknown.add(stamp);
  }
  EXPECT_EQ(known.frames(1), 60);
  EXPECT_EQ(unknown.frames(1), 10) << "a gap and a short interval do not count";
  EXPECT_EQ(unknown.frames(0.06), 1);
}

// A round trip whose loop closes, seen by a stage keyframe by keyframe: what it hands out, frame by frame.
std::vector<std::pair<FrameIndex, std::shared_ptr<const MapCorrection>>> corrections(bool threaded) {
  test::RoundTrip world;
  LoopStage stage(world.optics(), prompt(), {}, 1, threaded);
  std::vector<std::pair<FrameIndex, std::shared_ptr<const MapCorrection>>> handed_out;
  world.go(test::RoundTrip::kRound - 4);
  stage.start_at(world.map.keyframe_count());
  for (FrameIndex frame = 0; frame < 80; ++frame) {
    if (frame % 5 == 0 && frame < 40) {
      world.go(1);
      stage.offer(world.map.snapshot(), frame, FrameRate(30), false);
    }
    for (auto& correction : stage.take_due(frame, true)) {
      move_map(world.map, *correction);
      stage.offer(world.map.snapshot(), frame, FrameRate(30), false);
      handed_out.emplace_back(frame, std::move(correction));
    }
  }
  EXPECT_TRUE(stage.idle());
  for (const auto& [frame, correction] : handed_out) EXPECT_NE(correction->kind, MapCorrection::Kind::merge);
  return handed_out;
}

TEST(LoopStage, ALoopIsClosedAndThenTheMapAdjusted) {
  const auto handed_out = corrections(true);
  ASSERT_GE(handed_out.size(), 2U);
  EXPECT_EQ(handed_out[0].second->kind, MapCorrection::Kind::loop);
  EXPECT_EQ(handed_out.back().second->kind, MapCorrection::Kind::adjustment);
}

TEST(LoopStage, ThreadsDoNotChangeABit) {
  const auto with = corrections(true), without = corrections(false);
  ASSERT_EQ(with.size(), without.size());
  for (size_t i = 0; i < with.size(); ++i) {
    EXPECT_EQ(with[i].first, without[i].first);
    const auto &a = with[i].second->poses, &b = without[i].second->poses;
    ASSERT_EQ(a.size(), b.size());
    for (size_t k = 0; k < a.size(); ++k) {
      EXPECT_EQ(a[k].after.translation, b[k].after.translation);
      EXPECT_EQ(a[k].after.rotation.coeffs(), b[k].after.rotation.coeffs());
    }
  }
}

// The search was late, and the first of the keyframes that waited closes a loop: the map moves, and whoever it is too
// early to search there for is passed over for five keyframes. The others are not forgotten.
TEST(LoopStage, KeyframesThatWaitedWhenALoopWasFoundAreSearchedInTheMapThatItMoved) {
  test::RoundTrip world;
  world.go(test::RoundTrip::kRound + 2);
  const int first = world.map.keyframe_count();
  LoopStage stage(world.optics(), prompt(), {}, 1, false);
  stage.start_at(first - 1);
  world.go(12);
  const auto searched = [&] { return stage.take_times().summaries()["loop"].count; };
  stage.offer(world.map.snapshot(), 0, FrameRate(30), false);
  const auto found = stage.take_due(1000, true);
  ASSERT_EQ(found.size(), 1U);
  const auto at = static_cast<size_t>(found[0]->near_side.front() - (first - 1));
  EXPECT_EQ(searched(), at + 1) << "what was passed over took no time";
  move_map(world.map, *found[0]);
  stage.offer(world.map.snapshot(), 1001, FrameRate(30), false);
  stage.take_due(1001 + 1000, true);
  EXPECT_GT(searched(), 0U);
}

// In real time the search may be too late for all of them: the newest show where the camera is, back at the start.
TEST(LoopStage, OfKeyframesThatWaitedTheNewestAreSearched) {
  test::RoundTrip world;
  world.go(test::RoundTrip::kRound + 2);
  LoopStage stage(world.optics(), prompt(), {}, 1, false);
  stage.offer(world.map.snapshot(), 0, FrameRate(30), true);
  EXPECT_EQ(stage.take_due(100, true).size(), 1U);
}

// A search that is done and waits for its due frame keeps nobody busy.
TEST(LoopStage, SearchesThatAreDoneLeaveTimeForOthers) {
  test::RoundTrip world;
  LoopStage stage(world.optics(), prompt(), {}, 1, false);
  for (const int more : {test::RoundTrip::kRound - 2, 4}) {
    world.go(more);
    stage.offer(world.map.snapshot(), 0, FrameRate(30), true);
  }
  EXPECT_EQ(stage.take_due(100, true).size(), 1U);
}

// A loop that is closed while the map is being adjusted makes the adjustment of no use. The next one must not be
// overtaken as well, however many loops there are.
TEST(LoopStage, AnAdjustmentIsOvertakenOnce) {
  test::RoundTrip world;
  world.go(test::RoundTrip::kRound + 2);
  LoopStage stage(world.optics(), prompt(), {}, 1, false);
  stage.want_adjustment();
  stage.offer(world.map.snapshot(), 0, FrameRate(30), true);
  auto first = stage.take_due(1000, true);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_EQ(first[0]->kind, MapCorrection::Kind::loop);
  move_map(world.map, *first[0]);
  world.go(1);
  stage.offer(world.map.snapshot(), 1001, FrameRate(30), true);
  auto second = stage.take_due(2000, true);
  ASSERT_EQ(second.size(), 1U);
  EXPECT_EQ(second[0]->kind, MapCorrection::Kind::adjustment) << "the new keyframe waits";
  EXPECT_TRUE(stage.idle());
  stage.offer(world.map.snapshot(), 2001, FrameRate(30), true);
  EXPECT_FALSE(stage.idle()) << "its search";
}

// At its end a run takes what is outstanding at once, while mapping still culls keyframes: the next adjustment is asked
// for in the same frame, of a smaller map.
TEST(LoopStage, AMapThatHasShrunkIsAdjustedAsWell) {
  test::RoundTrip large, small;
  large.go(30), small.go(10);
  LoopStage stage(large.optics(), prompt(), {}, 1, false);
  for (const test::RoundTrip* world : {&large, &small}) {
    stage.start_at(world->map.keyframe_count());
    stage.want_adjustment();
    stage.offer(world->map.snapshot(), 0, FrameRate(30), false);
    EXPECT_EQ(stage.take_due(1000, true).size(), 1U);
  }
  EXPECT_TRUE(stage.idle());
}

// The time of an adjustment is a matter of the neighbours that its keyframes have: 45 of them are one keyframe's.
TEST(LoopStage, AnAdjustmentIsDueByTheNeighboursOfItsKeyframes) {
  test::RoundTrip world;
  world.go(30);
  int neighbours = 0;
  for (KeyframeId k : world.map.live_keyframes())
    neighbours += static_cast<int>(world.map.keyframe(k)->covisible.size());
  LoopStageOptions options = prompt();
  options.global_ba_latency = {1, 1};
  LoopStage stage(world.optics(), options, {}, 1, false);
  stage.start_at(world.map.keyframe_count());
  stage.want_adjustment();
  stage.offer(world.map.snapshot(), 0, FrameRate(30), false);
  const FrameIndex due = 30 * (1 + neighbours / 45);
  EXPECT_LT(due, 30 * 30);
  EXPECT_EQ(stage.take_due(due - 1, true).size(), 0U);
  EXPECT_EQ(stage.take_due(due, true).size(), 1U);
}

// A second map comes round to where the first one began.
TEST(LoopStage, AMergeIsAdjustedOnceItIsMadeAndWhatWasFoundBeforeIsOfNoUse) {
  test::RoundTrip world;
  world.go(12);
  LoopStage stage(world.optics(), prompt(), {}, 1, false);
  stage.start_at(world.map.keyframe_count());
  const Rigid3 other_from_world(rotation_from_vector({0.1, 1.2, -0.3}), {2, -1, 5});
  const auto go = [&](int keyframes) {
    for (int i = 0; i < keyframes; ++i) {
      const int k = world.map.keyframe_count();
      const Rigid3 truth = test::RoundTrip::truth_at(k - 20);
      world.add(truth, truth * other_from_world.inverse(), k == 12);
    }
  };
  std::vector<std::shared_ptr<const MapCorrection>> found;
  FrameIndex frame = 0;
  while (found.empty() && world.map.keyframe_count() < 30) {
    go(1);
    stage.offer(world.map.snapshot(), frame += 100, FrameRate(30), false);
    found = stage.take_due(frame + 99, true);
  }
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0]->kind, MapCorrection::Kind::merge);
  EXPECT_TRUE(stage.idle()) << "nothing has moved";
  go(6);  // which show the same
  stage.offer(world.map.snapshot(), frame += 100, FrameRate(30), false);
  stage.merged(*found[0]);
  move_map(world.map, *found[0]);
  for (const auto& later : stage.take_due(frame + 99, true)) EXPECT_NE(later->kind, MapCorrection::Kind::merge);
  stage.offer(world.map.snapshot(), frame += 100, FrameRate(30), false);
  found = stage.take_due(frame + 99, true);
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0]->kind, MapCorrection::Kind::adjustment);
}

TEST(LoopStage, EndsWithWorkOutstanding) {
  test::RoundTrip world;
  world.go(10);
  LoopStage stage(world.optics(), prompt(), {}, 1, true);
  stage.want_adjustment();
  stage.offer(world.map.snapshot(), 0, FrameRate(30), false);
  EXPECT_FALSE(stage.idle());
}

}  // namespace
}  // namespace dkb
