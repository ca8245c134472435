// SPDX-License-Identifier: Apache-2.0
#include "dkb/viewer/map_deltas.h"

#include <gtest/gtest.h>

#include <cstring>
#include <map>

#include "dkb/map/map_test_tools.h"

namespace dkb {
namespace {

Rigid3 at(double x) {
  return Rigid3({Eigen::Quaterniond::Identity()}, {x, 0, 0});
}

// `keyframes` keyframes a metre apart, each of which makes `points` points two metres before it.
Map world(int keyframes, int points) {
  Map map;
  for (KeyframeId k = 0; k < keyframes; ++k) {
    Keyframe keyframe = test::keyframe_at(k, 0, points);
    keyframe.frame = 10 * k;
    keyframe.cam_from_world = at(k).inverse();
    map.add_keyframe(keyframe);
    for (int i = 0; i < points; ++i) {
      MapPoint point;
      point.id = make_point_id(k, i);
      point.position = {k + 0.01 * i, 0, 2};
      point.born_at = k;
      map.add_point(point);
      map.observe(point.id, k, i);
    }
  }
  return map;
}
MapSnapshot snapshot_of(const Map& map, std::vector<LoopInfo> loops = {}) {
  return {map.snapshot(), std::move(loops)};
}

// What a client is sent, as it would keep it.
struct Reader {
  MapDeltas::Client client;
  std::map<int, float> keyframe_x;
  std::map<std::pair<uint32_t, uint16_t>, int16_t> point_x;
  std::map<int, size_t> counts;  // messages by kind
  size_t points_sent = 0, loops = 0, bytes = 0;

  bool take(const MapDeltas& deltas, size_t budget = 1 << 20) {
    StreamWriter out;
    const bool complete = deltas.write(client, out, budget);
    const std::string& s = out.bytes();
    bytes = s.size();
    points_sent = 0;
    counts.clear();
    const auto u32 = [&](size_t i) {
      uint32_t v;
      std::memcpy(&v, s.data() + i, 4);
      return v;
    };
    for (size_t i = 0; i < s.size();) {
      const size_t end = i + 8 + u32(i);
      const auto kind = static_cast<StreamMessage>(s[i + 4]);
      ++counts[s[i + 4]];
      i += 8;
      EXPECT_LE(end, s.size());
      if (kind == StreamMessage::keyframes)
        for (size_t k = i; k < end; k += 44) {
          float x;
          std::memcpy(&x, s.data() + k + 32, 4);
          keyframe_x[static_cast<int>(u32(k))] = x;
        }
      if (kind == StreamMessage::points)
        for (size_t b = i; b < end;) {
          const uint32_t host = u32(b), n = u32(b + 4);
          b += 8;
          for (uint32_t p = 0; p < n; ++p, b += 12) {
            uint16_t index;
            int16_t x;
            std::memcpy(&index, s.data() + b, 2);
            std::memcpy(&x, s.data() + b + 2, 2);
            if (s[b + 11] == 0)
              point_x.erase({host, index});
            else
              point_x[{host, index}] = x;
            ++points_sent;
          }
        }
      if (kind == StreamMessage::loops) loops = (end - i) / 12;
      i = end;
    }
    return complete;
  }
};

TEST(MapDeltas, TellAClientAllAndThenWhatChanged) {
  Map map = world(3, 5);
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(map));
  Reader reader;
  EXPECT_TRUE(reader.take(deltas));
  EXPECT_EQ(reader.keyframe_x, (std::map<int, float>{{0, 0}, {1, 1}, {2, 2}}));
  EXPECT_EQ(reader.point_x.size(), 15U);
  EXPECT_EQ((reader.point_x[{2, 3}]), 30);
  reader.take(deltas);
  EXPECT_EQ(reader.bytes, 0U);

  map.edit_point(make_point_id(1, 2)).position.x() += 0.05;
  map.edit_point(make_point_id(1, 3)).position.x() += 0.0004;  // below the unit
  map.remove_point(make_point_id(0, 0));
  deltas.update(snapshot_of(map));
  reader.take(deltas);
  EXPECT_EQ(reader.points_sent, 2U);
  EXPECT_EQ((reader.point_x[{1, 2}]), 70);
  EXPECT_EQ(reader.point_x.size(), 14U);
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
  EXPECT_FALSE(slow.take(deltas, 500));
  for (int i = 0; i < 10; ++i) {
    map.edit_point(make_point_id(i, 7)).position.x() += 0.1 * i;
    map.remove_point(make_point_id(i, 8));
    deltas.update(snapshot_of(map));
    quick.take(deltas);
    if (i % 4 == 0) slow.take(deltas, 500);
  }
  int parts = 0;
  while (!slow.take(deltas, 500)) ASSERT_LT(++parts, 100);
  EXPECT_EQ(slow.point_x, quick.point_x);
  EXPECT_EQ(slow.keyframe_x, quick.keyframe_x);
  EXPECT_EQ(quick.point_x.size(), map.point_count());
}

TEST(MapDeltas, BeginAnewWithAnotherWorld) {
  MapDeltas deltas(0.001);
  deltas.update(snapshot_of(world(5, 4)));
  Reader reader;
  reader.take(deltas);
  deltas.update(snapshot_of(world(2, 4)));
  EXPECT_TRUE(deltas.begun_anew(reader.client));
  reader.keyframe_x.clear();
  reader.point_x.clear();
  reader.take(deltas);
  EXPECT_EQ(reader.keyframe_x.size(), 2U);
  EXPECT_EQ(reader.point_x.size(), 8U);
}

}  // namespace
}  // namespace dkb
