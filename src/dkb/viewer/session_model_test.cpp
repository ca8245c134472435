// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_model.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "dkb/viewer/stream_test_tools.h"

namespace dkb {
namespace {

using test::StreamReader;

constexpr int kSurface = static_cast<int>(StreamMessage::surface);

// The camera goes along x, 1/30 s and 1 cm a frame, whatever the world.
ViewerOptions options_with_truth() {
  ViewerOptions options;
  options.port.reset();
  for (int i = 0; i < 100; ++i) options.truth.push_back({int64_t{33'000'000} * i, {0.01 * i, 0, 0}});
  return options;
}

// Frame `index` of a world of so many keyframes, at the time of frame `at` of the session.
void show(SessionModel& model, int keyframes, int index, int at) {
  FrameResult result;
  result.frame = index;
  result.stamp_ns = int64_t{33'000'000} * at;
  result.state = TrackingState::tracking;
  result.world_from_cam = Rigid3({Eigen::Quaterniond::Identity()}, {0.01 * at, 0, 0});
  result.reference_keyframe = 0;
  model.show(std::move(result), Frame(), {test::world(keyframes, 5).snapshot(), {}}, {});
  model.take_in();
}

std::string surface() {
  StreamWriter out;
  out.message(StreamMessage::surface, [](StreamWriter& m) { m.put(1.0F); });
  return std::move(out.bytes());
}

void tell(SessionModel& model, SessionModel::Client& client, StreamReader& reader) {
  StreamWriter out;
  model.write(client, out, 1 << 20);
  ASSERT_TRUE(reader.take(out.bytes()));
}

bool is_aligned(const StreamReader& reader) {
  return reader.frame.find("world_from_truth") != std::string::npos;
}

TEST(SessionModel, ANewWorldBeginsWithoutWhatLayInTheOneBefore) {
  SessionModel model(options_with_truth());
  SessionModel::Client client;
  StreamReader page;
  for (int i = 0; i < 30; ++i) show(model, 9, i, i);
  model.take_in_map(0);
  const uint64_t first = model.world();
  model.take_dense(surface(), first);
  tell(model, client, page);
  EXPECT_EQ(page.counts[kSurface], 1);
  EXPECT_TRUE(is_aligned(page));

  show(model, 2, 0, 50);
  model.take_in_map(0);
  EXPECT_NE(model.world(), first);
  tell(model, client, page);
  EXPECT_EQ(page.hellos, 2U);
  EXPECT_EQ(page.counts[kSurface], 0) << "it is of the first world";
  EXPECT_FALSE(is_aligned(page)) << "there is no path yet to lay the truth on";

  model.take_dense(surface(), first);  // was in the making
  tell(model, client, page);
  EXPECT_EQ(page.counts[kSurface], 0);
  model.take_dense(surface(), model.world());
  for (int i = 1; i < 30; ++i) show(model, 2, i, 50 + i);
  tell(model, client, page);
  EXPECT_EQ(page.counts[kSurface], 1);
  EXPECT_TRUE(is_aligned(page)) << "as soon as the new path is long enough";
}

TEST(SessionModel, ProgressReachesItsEndWhereFramesCannotBeRead) {
  ViewerOptions options = options_with_truth();
  options.frames = 10;
  SessionModel model(options);
  show(model, 1, 0, 0);
  EXPECT_EQ(model.state()["frames"], 10);
  model.skipped(7);
  for (int i = 1; i < 3; ++i) show(model, 1, i, i);
  EXPECT_EQ(model.state()["frames"], 3);
  EXPECT_EQ(model.frame() + 1, 3);
}

TEST(SessionModel, FeaturesOfALargeImageAreWhereTheyAre) {
  ViewerOptions options = options_with_truth();
  options.camera.width = 7680;
  options.camera.height = 4320;
  SessionModel model(options);
  FrameResult result;
  FeatureReport feature;
  feature.image_x = 7000;
  feature.image_y = 4300;
  result.features.push_back(feature);
  model.show(std::move(result), Frame(), {test::world(1, 1).snapshot(), {}}, {});
  model.take_in();
  SessionModel::Client client;
  StreamReader page;
  tell(model, client, page);
  uint32_t json = 0, count = 0;
  std::memcpy(&json, page.frame.data(), sizeof json);
  std::memcpy(&count, page.frame.data() + 4 + json, sizeof count);
  ASSERT_EQ(count, 1U);
  uint16_t at[2];
  std::memcpy(at, page.frame.data() + 8 + json, sizeof at);
  const double unit = 7680 / 65536.0;
  EXPECT_NEAR(at[0] * unit, 7000, unit);
  EXPECT_NEAR(at[1] * unit, 4300, unit);
}

// Frame `at` at x [m], hung on the newest keyframe.
void show_at(SessionModel& model, const Map& map, int at, double x) {
  FrameResult result;
  result.frame = at;
  result.stamp_ns = int64_t{33'000'000} * at;
  result.state = TrackingState::tracking;
  result.world_from_cam = Rigid3({Eigen::Quaterniond::Identity()}, {x, 0.1 * (at % 7), 0});
  result.reference_keyframe = map.keyframe_count() - 1;
  model.show(std::move(result), Frame(), {map.snapshot(), {}}, {});
  model.take_in();
}
double truth_lies_at(SessionModel& model) {
  SessionModel::Client client;
  StreamReader page;
  tell(model, client, page);
  const auto begin = page.frame.find("\"world_from_truth\":["), end = page.frame.find(']', begin);
  if (begin == std::string::npos) return std::numeric_limits<double>::quiet_NaN();
  const std::string pose = page.frame.substr(begin, end - begin);
  // q x y z w, then x.
  size_t comma = 0;
  for (int i = 0; i < 4; ++i) comma = pose.find(',', comma + 1);
  return std::stod(pose.substr(comma + 1));
}
ViewerOptions options_with_long_truth(int frames) {
  ViewerOptions options;
  options.port.reset();
  for (int i = 0; i < frames; ++i)
    options.truth.push_back({int64_t{33'000'000} * i, {static_cast<double>(i), 0.1 * (i % 7), 0}});
  return options;
}

TEST(SessionModel, TheTruthIsLaidOnThePathAnewAfterItWasThinned) {
  const int frames = static_cast<int>(2.2 * static_cast<double>(SessionHistory::kPath));
  SessionModel model(options_with_long_truth(frames));
  const Map map = test::world(1, 1);
  double before = 0;
  for (int i = 0; i < frames; ++i) {
    // The estimate drifts: where the truth lies depends on how much of the path is there.
    show_at(model, map, i, i + 1e-5 * i * i / 1000);
    if (i % 200 != 0) continue;
    const double now = truth_lies_at(model);
    if (i == 19800) before = now;
  }
  EXPECT_GT(std::abs(truth_lies_at(model) - before), 1e-3);
}

TEST(SessionModel, TheTruthIsLaidOnThePathAnewAfterACorrectionAndAtTheEnd) {
  SessionModel model(options_with_long_truth(100));
  Map map = test::world(20, 1);
  const double first = map.cam_from_world(19).inverse().translation.x();
  for (int i = 0; i < 30; ++i) show_at(model, map, i, i + first);
  model.take_in_map(0);
  EXPECT_NEAR(truth_lies_at(model), first, 1e-3);
  for (KeyframeId k = 0; k < 20; ++k)
    map.set_pose(k, map.cam_from_world(k) * Rigid3({Eigen::Quaterniond::Identity()}, {-5, 0, 0}));
  show_at(model, map, 30, 30 + first + 5);
  model.take_in_map(0);
  EXPECT_NEAR(truth_lies_at(model), first + 5, 1e-3);
  map.set_pose(19, map.cam_from_world(19) * Rigid3({Eigen::Quaterniond::Identity()}, {-2, 0, 0}));
  model.end({map.snapshot(), {}});
  model.take_in();
  EXPECT_NEAR(truth_lies_at(model), first + 7, 1e-3);
}

TEST(SessionModel, TheFirstFramesOfANewMapHangOnNoKeyframeOfTheOneBefore) {
  SessionModel model(options_with_truth());
  const Map map = test::world(9, 1);  // whose snapshot does not have the new map yet
  const auto result_at = [](int frame, int number, KeyframeId reference) {
    FrameResult result;
    result.frame = frame;
    result.state = TrackingState::tracking;
    result.world_from_cam = Rigid3({Eigen::Quaterniond::Identity()}, {1.0 * frame, 0, 0});
    result.map = number;
    result.reference_keyframe = reference;
    return result;
  };
  const auto path = [&] {
    SessionModel::Client client;
    StreamReader page;
    tell(model, client, page);
    return page.path;
  };
  model.take_in();
  model.show(result_at(0, 0, 0), Frame(), {map.snapshot(), {}}, {});
  // Keyframe 12 is not in the snapshot either, but its map is: the newest known one of that map stands in.
  model.show(result_at(1, 0, 12), Frame(), {map.snapshot(), {}}, {});
  model.take_in();
  model.take_in_map(0);
  EXPECT_EQ(path(), 2U);
  model.show(result_at(2, 1, 13), Frame(), {map.snapshot(), {}}, {});
  model.show(result_at(3, 1, 13), Frame(), {map.snapshot(), {}}, {});
  model.take_in();
  EXPECT_EQ(path(), 3U) << "the path is broken there, and goes on with the new map's first snapshot";
}

TEST(SessionModel, AFrameTellsTheRootOfTheMapThatItIsIn) {
  SessionModel model(options_with_truth());
  Map map = test::unjoined(3);
  const auto told = [&](int frame, bool tracked, int number, KeyframeId reference) {
    FrameResult result;
    result.frame = frame;
    if (tracked) result.world_from_cam = Rigid3();
    result.map = number;
    result.reference_keyframe = reference;
    model.show(std::move(result), Frame(), {map.snapshot(), {}}, {});
    model.take_in();
    SessionModel::Client client;
    StreamReader page;
    tell(model, client, page);
    const size_t at = page.frame.find("\"map\":");
    return at == std::string::npos ? -9 : std::stoi(page.frame.substr(at + 6));
  };
  EXPECT_EQ(told(0, true, 0, 0), 0);
  EXPECT_EQ(told(1, false, 0, -1), -1) << "lost: in none";
  EXPECT_EQ(told(2, true, 2, 2), 2);
  EXPECT_EQ(told(3, true, 3, 5), 5) << "a new map, whose first keyframe is not in the snapshot yet";
  map.set_parent(1, 0);
  EXPECT_EQ(told(4, true, 1, 2), 2) << "maps before it were joined";
}

}  // namespace
}  // namespace dkb
