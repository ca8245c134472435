// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_history.h"

#include <gtest/gtest.h>

#include <cstring>

#include "dkb/viewer/stream_test_tools.h"

namespace dkb {
namespace {

using test::unjoined;

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
  EXPECT_GT(bytes_for(history, client), 100U * (16 + 20));
  EXPECT_EQ(bytes_for(history, client), 0U);
  history.add(fact(100, 10));
  EXPECT_EQ(bytes_for(history, client), 8U + 16 + 8 + 20);
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
  EXPECT_EQ(bytes_for(history, client), 8U + 16 + 8 + 8 + 4);
  SessionHistory::Client late;
  EXPECT_EQ(bytes_for(history, late), first + 16 + 8 + 4);
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

// Frames of the points of the path, -1 where it is broken.
std::vector<int> path_frames(const SessionHistory& history) {
  SessionHistory::Client client;
  StreamWriter out;
  history.write(client, out, 1);
  const std::string& bytes = out.bytes();
  std::vector<int> frames;
  for (size_t at = 0; at < bytes.size();) {
    uint32_t head[2];
    std::memcpy(head, bytes.data() + at, sizeof head);
    at += sizeof head;
    for (size_t p = at; head[1] == static_cast<uint32_t>(StreamMessage::path) && p < at + head[0]; p += 20) {
      int32_t point[2];
      std::memcpy(point, bytes.data() + p, sizeof point);
      frames.push_back(point[1] == kNoKeyframe ? -1 : point[0]);
    }
    at += head[0];
  }
  return frames;
}

TEST(SessionHistory, APathThatIsOftenBrokenIsThinnedAsAWhole) {
  for (const int stretch : {1, 2, 5}) {  // frames until the camera is lost for one
    SessionHistory history;
    const int count = static_cast<int>(2.5 * static_cast<double>(SessionHistory::kPath));
    for (int i = 0; i < count; ++i) {
      FrameFact f = fact(i, 10 * i);
      if (i % (stretch + 1) == stretch) f.host = kNoKeyframe;
      history.add(f);
      ASSERT_LE(history.path_size(), SessionHistory::kPath) << i;
    }
    const std::vector<int> frames = path_frames(history);
    int last = 0;
    for (size_t i = 0; i < frames.size(); ++i) {
      if (frames[i] < 0) {
        EXPECT_TRUE(i > 0 && frames[i - 1] >= 0) << "broken once is enough";
        continue;
      }
      EXPECT_LE(frames[i] - last, 8 * (stretch + 1)) << "a part is missing";
      last = frames[i];
    }
    EXPECT_GE(last, count - 8 * (stretch + 1)) << "the newest part is missing";
  }
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
  const Map map = unjoined(1);
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

TEST(SessionHistory, BringsTheTruthToTheMapThatTheNewestPoseIsIn) {
  const Map map = unjoined(2);
  SessionHistory history;
  std::vector<ViewerOptions::TruePosition> truth;
  const Rigid3 of_first({Eigen::Quaterniond::Identity()}, {1, 2, 3});
  const Rigid3 of_second({Eigen::Quaterniond(Eigen::AngleAxisd(1.5, Eigen::Vector3d::UnitZ()))}, {-4, 0, 1});
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d position(0.1 * i, 0.05 * (i % 7), 0.02 * (i % 5));
    FrameFact f = fact(i, 0);
    f.host = i < 40 ? 0 : 1;
    f.position_in_host = (i < 40 ? of_first : of_second) * position;
    history.add(f);
    truth.push_back({f.stamp_ns, position});
    if (i < 39) continue;
    EXPECT_EQ(history.current_root(map), f.host);
    const auto found = history.world_from_truth(map, truth);
    ASSERT_EQ(found.has_value(), i < 40 || i >= 49) << i;
    if (found) {
      EXPECT_LT(found->rotation.angularDistance((i < 40 ? of_first : of_second).rotation), 1e-9) << i;
    }
  }
}

}  // namespace
}  // namespace dkb
