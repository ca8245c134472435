// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/map/map.h"
#include "dkb/map/map_test_tools.h"

namespace dkb {
namespace {

using test::broken_invariant;
using test::ThreeKeyframes;

TEST(Map, AnAppendedMapIsAMapOfItsOwnWithNamesOfItsOwn) {
  ThreeKeyframes first, second;
  second.map.fuse(second.b, second.a);
  first.map.append(second.map);
  const Map& both = first.map;
  EXPECT_EQ(both.keyframe_count(), 6);
  EXPECT_EQ(both.roots(), (std::vector<KeyframeId>{0, 3}));
  EXPECT_EQ(both.keyframe(4)->parent, 3);
  EXPECT_EQ(both.point_count(), 4U + 3U);
  EXPECT_EQ(both.resolve(make_point_id(3, 1)), make_point_id(3, 0)) << "fusions are renamed as well";
  EXPECT_EQ(both.point(make_point_id(3, 0))->observations.size(), 3U);
  EXPECT_EQ(both.keyframe(3)->frame, both.keyframe(0)->frame + 1);
  EXPECT_EQ(broken_invariant(both), "");
  for (uint64_t seed = 1; seed <= 10; ++seed) {
    Map a = test::random_map(seed, 8, 40, 10);
    const Map b = test::random_map(seed + 100, 6, 40, 10);
    const size_t points = a.point_count() + b.point_count();
    a.append(b);
    ASSERT_EQ(broken_invariant(a), "") << seed;
    EXPECT_EQ(a.point_count(), points);
    EXPECT_EQ(a.live_keyframe_count() - b.live_keyframe_count(),
              test::random_map(seed, 8, 40, 10).live_keyframe_count());
  }
}

}  // namespace
}  // namespace dkb
