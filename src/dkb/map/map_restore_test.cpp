// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/map/map.h"
#include "dkb/map/map_test_tools.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

using test::broken_invariant;
using test::fingerprint;
using test::ThreeKeyframes;

struct Parts {
  std::vector<Keyframe> keyframes;
  std::vector<MapPoint> points;
  std::vector<RemovedPoint> removed;
};

Parts parts_of(const Map& map) {
  Parts parts;
  for (KeyframeId id = 0; id < map.keyframe_count(); ++id) {
    parts.keyframes.push_back(*map.keyframe(id));
    for (PlaneId& p : parts.keyframes.back().plane_of_patch) p = map.plane(p);
  }
  for (PointId id : map.live_points()) parts.points.push_back(*map.point(id));
  parts.removed = map.removed_points();
  return parts;
}

TEST(MapRestore, GivesTheSameMapFromItsParts) {
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    const Map map = test::random_map(seed, 10, 20, 20);
    const Parts parts = parts_of(map);
    Map restored = Map::restore(parts.keyframes, parts.points, parts.removed);
    ASSERT_EQ(fingerprint(restored), fingerprint(map));
    // The restored map goes on as the first would have.
    Map other = map;
    Random a(seed), b(seed);
    for (int i = 0; i < 50; ++i) {
      test::random_edit(other, a);
      test::random_edit(restored, b);
    }
    ASSERT_EQ(fingerprint(restored), fingerprint(other));
    ASSERT_EQ(broken_invariant(restored), "");
  }
}

TEST(MapRestore, RefusesPartsThatContradictOneAnother) {
  ThreeKeyframes world;
  world.map.fuse(world.d, world.c);
  world.map.update_covisibility(1, 1);
  const Parts good = parts_of(world.map);
  const auto message = [&](auto&& spoil) {
    Parts parts = good;
    spoil(parts);
    return test::input_error_of([&] { Map::restore(parts.keyframes, parts.points, parts.removed); });
  };
  EXPECT_EQ(message([](Parts&) {}), "no error");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].id = 2; }), "keyframe 2 stands where keyframe 1 should");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].parent = 3; }), "keyframe 1 has the impossible parent 3");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].parent = -2; }), "keyframe 1 has the impossible parent -2");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[0].parent = 2; }), "parents of keyframes run in a circle");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[0].culled = true; }), "keyframe 0 is culled but has no parent");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].culled = true; }), "keyframe 1 is culled but has features");
  EXPECT_EQ(message([](Parts& p) {
              Keyframe& culled = p.keyframes[1];
              culled.culled = true;
              culled.features.reset();
              culled.points.clear();
              culled.covisible.clear();
              culled.parent = 0;
              p.keyframes[2].parent = 1;
            }),
            "keyframe 2 hangs on culled keyframe 1");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].features.reset(); }),
            "keyframe 1 has not as many points and descriptors as features");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].points.pop_back(); }),
            "keyframe 1 has not as many points and descriptors as features");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].covisible[0].keyframe = 1; }),
            "keyframe 1 names an impossible covisible keyframe");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[1].covisible[0].shared_points = 0; }),
            "keyframe 1 names an impossible covisible keyframe");
  EXPECT_EQ(message([](Parts& p) { std::swap(p.keyframes[1].covisible[0], p.keyframes[1].covisible[1]); }),
            "covisible keyframes of keyframe 1 are out of order");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[0].covisible.clear(); }),
            "two keyframes disagree on how many points they share");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[2].points[3] = make_point_id(0, 5); }),
            "keyframe 2 shows point 5, which is not there");
  EXPECT_EQ(message([](Parts& p) { p.keyframes[2].points[3] = make_point_id(0, 0); }),
            "keyframe 2 shows point 0 twice");
  EXPECT_EQ(message([](Parts& p) { std::swap(p.points[0], p.points[1]); }), "point 0 is out of order");
  EXPECT_EQ(message([](Parts& p) { p.points[0].id = make_point_id(7, 0); }),
            "point 57344 was born at a keyframe that is not there");  // 7 * 8192
  EXPECT_EQ(message([](Parts& p) { p.removed[0].id = 0; }), "point 0 is both there and removed");
  EXPECT_EQ(message([](Parts& p) { p.removed[0].replaced_by = 5; }),
            "point 3 was replaced by point 5, which never was");
  EXPECT_EQ(message([](Parts& p) { p.removed[0].replaced_by = 3; }), "replacements of points run in a circle");
}

}  // namespace
}  // namespace dkb
