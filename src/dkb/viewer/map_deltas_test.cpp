// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/map_deltas.h"

#include <gtest/gtest.h>

#include <array>
#include <map>

#include "dkb/viewer/stream_test_tools.h"

namespace dkb {
namespace {

using test::world;

MapSnapshot snapshot_of(const Map& map, std::vector<LoopInfo> loops = {}) {
  return {map.snapshot(), std::move(loops)};
}

// A client that keeps what it is sent.
struct Reader : test::StreamReader {
  MapDeltas::Client client;
  size_t bytes = 0;

  void take(const MapDeltas& deltas, size_t budget = 1 << 20) {
    StreamWriter out;
    deltas.write(client, out, budget);
    bytes = out.size();
    points_sent = 0;
    counts.clear();
    EXPECT_TRUE(StreamReader::take(out.bytes()));
  }
};

TEST(MapDeltas, TellAClientAllAndThenWhatChanged) {
  Map map = world(3, 5);
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(map));
  Reader reader;
  reader.take(deltas);
  EXPECT_EQ(reader.keyframes, (std::map<int, std::array<float, 3>>{{0, {0, 0, 0}}, {1, {1, 0, 0}}, {2, {2, 0, 0}}}));
  EXPECT_EQ(reader.points.size(), 15U);
  EXPECT_EQ((reader.points[{2, 3}][0]), 30);
  reader.take(deltas);
  EXPECT_EQ(reader.bytes, 0U);

  map.edit_point(make_point_id(1, 2)).position.x() += 0.05;
  map.edit_point(make_point_id(1, 3)).position.x() += 0.0004;  // below the unit
  map.remove_point(make_point_id(0, 0));
  deltas.update(snapshot_of(map));
  reader.take(deltas);
  EXPECT_EQ(reader.points_sent, 2U);
  EXPECT_EQ((reader.points[{1, 2}][0]), 70);
  EXPECT_EQ(reader.points.size(), 14U);
}

TEST(MapDeltas, SendPosesAloneWhenTheMapMovesAsAWhole) {
  Map map = world(4, 50);
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(map));
  Reader reader;
  reader.take(deltas);
  const Rigid3 shift = {Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY())), {0.5, 0, 0.2}};
  for (const PointId id : map.live_points()) map.edit_point(id).position = shift * map.point(id)->position;
  for (const KeyframeId id : map.live_keyframes()) map.set_pose(id, map.cam_from_world(id) * shift.inverse());
  deltas.update(snapshot_of(map, {{3, 0, false}}));
  reader.take(deltas);
  EXPECT_EQ(reader.points_sent, 0U);
  EXPECT_EQ(reader.counts[static_cast<int>(StreamMessage::keyframes)], 1U);
  EXPECT_EQ(reader.loops, 1U);
}

TEST(MapDeltas, GiveAClientThatMissedUpdatesTheSameMapInSmallParts) {
  Map map = world(20, 30);
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(map));
  Reader quick, slow;
  quick.take(deltas);
  slow.take(deltas, 500);
  EXPECT_LT(slow.points.size(), quick.points.size());
  for (int i = 0; i < 10; ++i) {
    map.edit_point(make_point_id(i, 7)).position.x() += 0.1 * i;
    map.remove_point(make_point_id(i, 8));
    deltas.update(snapshot_of(map));
    quick.take(deltas);
    if (i % 4 == 0) slow.take(deltas, 500);
  }
  int parts = 0;
  do {
    ASSERT_LT(++parts, 100);
    slow.take(deltas, 500);
  } while (slow.bytes > 0);
  EXPECT_EQ(slow.points, quick.points);
  EXPECT_EQ(slow.keyframes, quick.keyframes);
  EXPECT_EQ(quick.points.size(), map.point_count());
}

TEST(MapDeltas, TellWhichKeyframesAreJoinedThoughNoneMoves) {
  Map map = test::unjoined(3);
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(map));
  Reader reader;
  reader.take(deltas);
  EXPECT_EQ(reader.roots, (std::map<int, int>{{0, 0}, {1, 1}, {2, 2}}));
  map.set_parent(2, 1);
  deltas.update(snapshot_of(map));
  reader.take(deltas);
  EXPECT_EQ(reader.roots, (std::map<int, int>{{0, 0}, {1, 1}, {2, 1}}));
  reader.take(deltas);
  EXPECT_EQ(reader.bytes, 0U);
}

TEST(MapDeltas, BeginAnewWithAnotherWorld) {
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(world(5, 4)));
  Reader reader;
  reader.take(deltas);
  deltas.update(snapshot_of(world(2, 4)));
  EXPECT_TRUE(deltas.begun_anew(reader.client));
  reader.keyframes.clear();
  reader.points.clear();
  reader.take(deltas);
  EXPECT_EQ(reader.keyframes.size(), 2U);
  EXPECT_EQ(reader.points.size(), 8U);
}

TEST(MapDeltas, BeginAnewWithALoadedMapOfAsManyKeyframes) {
  MapDeltas deltas(0.001);
  Map map = world(5, 4);
  deltas.update(snapshot_of(map));
  Reader reader;
  reader.take(deltas);
  map.edit_point(make_point_id(1, 2)).position.x() += 0.05;
  deltas.update(snapshot_of(map));
  EXPECT_FALSE(deltas.begun_anew(reader.client));
  Map loaded = world(6, 4);
  loaded.date_back();
  deltas.update(snapshot_of(loaded));
  EXPECT_TRUE(deltas.begun_anew(reader.client));
  reader.keyframes.clear();
  reader.points.clear();
  reader.take(deltas);
  EXPECT_EQ(reader.keyframes.size(), 6U);
}

}  // namespace
}  // namespace dkb
