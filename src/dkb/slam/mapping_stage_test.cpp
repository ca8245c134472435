// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/mapping_stage.h"

#include <gtest/gtest.h>

#include "dkb/mapping/test_map.h"

namespace dkb {
namespace {

class MappingStageTest : public ::testing::Test, protected PacketSource {
 protected:
  LocalMapper mapper() const { return LocalMapper(scene.optics(), {}); }
  KeyframePacket next() {
    const int k = static_cast<int>(shows.size());
    return packet(TestScene::camera_at({0.1 * k, 0.03 * (k % 2), 0}),
                  {.pixel_noise = 0.5, .depth_share = 0.8, .clutter = 50, .seed = static_cast<uint64_t>(k) + 1});
  }
};

TEST_F(MappingStageTest, AResultIsVisibleAtItsDueFrameAndNotBefore) {
  for (const bool threaded : {false, true}) {
    SCOPED_TRACE(threaded ? "with a thread" : "without a thread");
    MappingStage stage(mapper(), threaded);
    *static_cast<PacketSource*>(this) = {};
    stage.push(next(), 12);
    EXPECT_EQ(stage.outstanding(), 1U);
    EXPECT_FALSE(stage.take_due(10, true));
    EXPECT_FALSE(stage.take_due(11, true)) << "even when mapping is long done";
    const auto view = stage.take_due(12, true);
    ASSERT_TRUE(view);
    EXPECT_EQ((*view)->keyframe_count(), 1);
    EXPECT_EQ(stage.outstanding(), 0U);
    EXPECT_FALSE(stage.take_due(13, true));
  }
}

TEST_F(MappingStageTest, ALateCallerGetsTheNewestOfWhatIsDue) {
  MappingStage stage(mapper(), true);
  stage.push(next(), 3);
  stage.push(next(), 5);
  stage.push(next(), 9);
  const auto view = stage.take_due(6, true);
  ASSERT_TRUE(view);
  EXPECT_EQ((*view)->keyframe_count(), 2);
  EXPECT_EQ(stage.outstanding(), 1U);
}

TEST_F(MappingStageTest, ViewsAreTheSameWithAndWithoutAThread) {
  MappingStage with(mapper(), true), without(mapper(), false);
  for (FrameIndex frame = 0; frame < 40; ++frame) {
    const auto a = with.take_due(frame, true), b = without.take_due(frame, true);
    ASSERT_EQ(a.has_value(), b.has_value()) << "frame " << frame;
    if (a) {
      ASSERT_EQ((*a)->live_points(), (*b)->live_points());
      for (PointId id : (*a)->live_points()) ASSERT_EQ((*a)->point(id)->position, (*b)->point(id)->position);
      for (KeyframeId k = 0; k < (*a)->keyframe_count(); ++k)
        ASSERT_EQ((*a)->cam_from_world(k).translation, (*b)->cam_from_world(k).translation);
    }
    if (frame % 5 != 0) continue;
    const KeyframePacket packet = next();
    with.push(packet, frame + 2);
    without.push(packet, frame + 2);
  }
}

TEST_F(MappingStageTest, WhoDoesNotWaitIsNeverHeldUpAndGetsEverythingInTheEnd) {
  MappingStage stage(mapper(), true);
  int seen = 0;
  for (FrameIndex frame = 0; frame < 20; ++frame) {
    if (const auto view = stage.take_due(frame, false)) {
      EXPECT_GT((*view)->keyframe_count(), seen);
      seen = (*view)->keyframe_count();
    }
    if (frame % 4 == 0) stage.push(next(), frame + 2);
  }
  const auto view = stage.drain();
  EXPECT_EQ(view ? (*view)->keyframe_count() : seen, 5);
  EXPECT_EQ(stage.outstanding(), 0U);
}

TEST_F(MappingStageTest, DrainingTakesAllWhateverIsDueWhen) {
  MappingStage stage(mapper(), true);
  EXPECT_FALSE(stage.drain());
  stage.push(next(), 12);
  KeyframePacket report;  // the last word of tracking
  report.visibility = {{id_of[0], 1, 1}};
  stage.push(report, 13);
  const auto view = stage.drain();
  ASSERT_TRUE(view);
  EXPECT_EQ((*view)->keyframe_count(), 1);
  EXPECT_EQ(stage.outstanding(), 0U);
}

TEST_F(MappingStageTest, WhatWasHandedOverIsWorkedIn) {
  MappingStage stage(mapper(), true);
  for (int k = 0; k < 5; ++k) stage.push(next(), 2 * k);
  const auto view = stage.drain();
  ASSERT_TRUE(view);
  EXPECT_EQ((*view)->keyframe_count(), 5);
}

TEST_F(MappingStageTest, EndsWithWorkOutstanding) {
  MappingStage stage(mapper(), true);
  for (int k = 0; k < 5; ++k) stage.push(next(), 2 * k);
  EXPECT_GT(stage.outstanding(), 0U);
}

}  // namespace
}  // namespace dkb
