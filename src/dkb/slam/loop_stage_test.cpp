// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/loop_stage.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/loop/loop_test_world.h"

namespace dkb {
namespace {

const FrameRate kRate(30);

LoopStageOptions prompt() {
  LoopStageOptions options;
  options.loop_latency = {3 / 30.0, 0.1 / 30};
  options.global_ba_latency = {5 / 30.0, 0.1 / 30};
  return options;
}

TEST(BackgroundLatency, GrowsWithTheMapInWholeFrames) {
  const BackgroundLatency latency{10 / 30.0, 0.02 / 30};
  EXPECT_EQ(kRate.frames(latency(0)), 10);
  EXPECT_EQ(kRate.frames(latency(1)), 11);
  EXPECT_EQ(kRate.frames(latency(50)), 11);
  EXPECT_EQ(kRate.frames(latency(2000)), 50);
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
      stage.offer(world.map.snapshot(), frame, kRate, false);
    }
    for (auto& correction : stage.take_due(frame, true)) {
      move_map(world.map, *correction);
      stage.offer(world.map.snapshot(), frame, kRate, false);
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

TEST(LoopStage, EndsWithWorkOutstanding) {
  test::RoundTrip world;
  world.go(10);
  LoopStage stage(world.optics(), prompt(), {}, 1, true);
  stage.want_adjustment();
  stage.offer(world.map.snapshot(), 0, kRate, false);
  EXPECT_FALSE(stage.idle());
}

}  // namespace
}  // namespace dkb
