// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_history.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

FrameFact fact(int frame, double x) {
  FrameFact f;
  f.frame = frame;
  f.stamp_ns = int64_t{33'000'000} * frame;
  f.host = 0;
  f.state = TrackingState::tracking;
  f.position_in_host = {x, 0, 0};
  return f;
}
size_t bytes_for(const SessionHistory& history, SessionHistory::Client& client) {
  StreamWriter out;
  history.write(client, out, 1);
  return out.size();
}

TEST(SessionHistory, TellsEachClientOnce) {
  SessionHistory history;
  for (int i = 0; i < 100; ++i) history.add(fact(i, 0.1 * i));
  history.add(SessionEvent{"note", "hello", 3, 0});
  SessionHistory::Client client;
  EXPECT_GT(bytes_for(history, client), 100U * (20 + 20));
  EXPECT_EQ(bytes_for(history, client), 0U);
  history.add(fact(100, 10));
  EXPECT_EQ(bytes_for(history, client), 8U + 20 + 8 + 20);
}

TEST(SessionHistory, TellsStagesByNumberAndTheirNamesOnce) {
  SessionHistory history;
  FrameFact f = fact(0, 0);
  f.stages = {{"features", 2.5F}, {"flow", 1.0F}};
  history.add(f);
  SessionHistory::Client client;
  const size_t first = bytes_for(history, client);
  f.frame = 1;
  f.stages = {{"flow", 3000.0F}};
  history.add(f);
  // A fact; one stage; no further point of the path.
  EXPECT_EQ(bytes_for(history, client), 8U + 20 + 8 + 12 + 4);
  SessionHistory::Client late;
  EXPECT_EQ(bytes_for(history, late), first + 20 + 12 + 4);
}

TEST(SessionHistory, StaysBoundedOverADay) {
  SessionHistory history;
  SessionHistory::Client early;
  for (int i = 0; i < 24 * 3600 * 30; ++i) {
    FrameFact f = fact(i, 0.02 * (i % 100000));
    f.stages = {{"features", 2.5F}, {"flow", 1.0F}};
    history.add(f);
    if (i % 100 == 0) history.add(SessionEvent{"keyframe", "", i, 0});
    if (i == 50) bytes_for(history, early);
  }
  EXPECT_LT(history.path_size(), SessionHistory::kPath);
  SessionHistory::Client late;
  EXPECT_LT(bytes_for(history, late), 1'000'000U);
  EXPECT_LT(bytes_for(history, early), 1'000'000U);
}

TEST(SessionHistory, StandingStillMakesNoPath) {
  SessionHistory history;
  for (int i = 0; i < 1000; ++i) history.add(fact(i, 0.001));
  EXPECT_EQ(history.path_size(), 1U);
  FrameFact lost = fact(1000, 0);
  lost.host = kNoKeyframe;
  history.add(lost);
  history.add(lost);
  EXPECT_EQ(history.path_size(), 2U);
}

TEST(SessionHistory, BringsTheTruthToTheMap) {
  Map map;
  Keyframe keyframe;
  keyframe.id = 0;
  keyframe.features = std::make_shared<RgbdFeatures>();
  map.add_keyframe(keyframe);
  SessionHistory history;
  std::vector<ViewerOptions::TruePosition> truth;
  const Rigid3 truth_from_world({Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()))}, {1, 2, 3});
  for (int i = 0; i < 50; ++i) {
    FrameFact f = fact(i, 0);
    f.position_in_host = {0.1 * i, 0.05 * (i % 7), 0.02 * (i % 5)};
    history.add(f);
    truth.push_back({f.stamp_ns + 5'000'000, truth_from_world * f.position_in_host});
    if (i == 5) {
      EXPECT_FALSE(history.world_from_truth(map, truth));
    }
  }
  const auto found = history.world_from_truth(map, truth);
  ASSERT_TRUE(found);
  EXPECT_LT((found->translation - truth_from_world.inverse().translation).norm(), 1e-9);
}

}  // namespace
}  // namespace dkb
