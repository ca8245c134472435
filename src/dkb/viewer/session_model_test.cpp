// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/session_model.h"

#include <gtest/gtest.h>

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

}  // namespace
}  // namespace dkb
