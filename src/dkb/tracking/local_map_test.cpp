// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/local_map.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/matching/test_scene.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr int kFeatures = 20;

// Keyframes of 20 features; `sees` gives the points by feature.
void add_keyframe(Map& map, const std::vector<PointId>& sees) {
  Keyframe k;
  k.id = map.keyframe_count();
  auto features = std::make_shared<RgbdFeatures>();
  features->keypoints.resize(kFeatures);
  features->descriptors.resize(kFeatures);
  k.features = features;
  k.points = sees;
  k.points.resize(kFeatures, kNoPoint);
  k.parent = k.id == 0 ? kNoKeyframe : k.id - 1;
  map.add_keyframe(std::move(k));
}

PointId add_point(Map& map, KeyframeId keyframe, int feature) {
  MapPoint p;
  p.id = make_point_id(keyframe, feature);
  p.position = {0.1 * feature, 1.0 * keyframe, 2};
  map.add_point(p);
  map.observe(p.id, keyframe, feature);
  return p.id;
}

// Keyframe 0 sees points a0 ... a4, keyframe 1 sees a3, a4 and makes b10 ... b14, keyframe 2 sees b14 and makes c15,
// c16.
struct Chain {
  Chain() {
    add_keyframe(map, {});
    for (int f = 0; f < 5; ++f) a.push_back(add_point(map, 0, f));
    add_keyframe(map, {a[3], a[4]});
    for (int f = 10; f < 15; ++f) b.push_back(add_point(map, 1, f));
    add_keyframe(map, {b[4]});
    for (int f = 15; f < 17; ++f) c.push_back(add_point(map, 2, f));
    for (KeyframeId k = 0; k < 3; ++k) map.update_covisibility(k, 1);
  }
  Map map;
  std::vector<PointId> a, b, c;
};

std::vector<PointId> ids_of(const std::vector<Candidate>& candidates) {
  std::vector<PointId> ids;
  for (const Candidate& c : candidates) ids.push_back(c.id);
  return ids;
}

std::vector<PointId> operator+(std::vector<PointId> x, const std::vector<PointId>& y) {
  x.insert(x.end(), y.begin(), y.end());
  return x;
}

TEST(LocalMap, PointsThatAreNotInTheMapVoteForNobody) {
  const Chain w;
  EXPECT_TRUE(local_map_candidates({kNoPoint, make_point_id(7, 3), make_point_id(0, 9)}, w.map).empty());
  EXPECT_TRUE(local_map_candidates({}, w.map).empty());
  EXPECT_TRUE(local_map_candidates({kNoPoint}, w.map).empty());
}

TEST(LocalMap, HoldsTheVotedKeyframesAndTheirNeighbours) {
  const Chain w;
  EXPECT_EQ(ids_of(local_map_candidates({w.a[0]}, w.map)), w.a + w.b);        // keyframe 0 and its neighbour 1
  EXPECT_EQ(ids_of(local_map_candidates({w.a[3]}, w.map)), w.a + w.b + w.c);  // keyframes 0 and 1, whose neighbour is 2
}

TEST(LocalMap, HoldsSixtyKeyframesAtMost) {
  // 30 keyframes that see one point share two more with two others each; each of the 90 makes a point of its own.
  constexpr int kOwn = 10;
  Map map;
  const PointId seen_by_all = make_point_id(0, 0);
  for (int k = 0; k < 30; ++k) {
    add_keyframe(map, k == 0 ? std::vector<PointId>{} : std::vector<PointId>{seen_by_all});
    if (k == 0) add_point(map, k, 0);
    for (int feature : {1, 2, kOwn}) add_point(map, k, feature);
  }
  for (int k = 30; k < 90; ++k) {
    const KeyframeId first = (k - 30) / 2;
    add_keyframe(map, {make_point_id(first, 1), make_point_id(first, 2)});
    add_point(map, k, kOwn);
  }
  for (KeyframeId k = 0; k < 90; ++k) map.update_covisibility(k, 1);
  const std::vector<PointId> ids = ids_of(local_map_candidates({seen_by_all}, map));
  EXPECT_EQ(std::count_if(ids.begin(), ids.end(), [](PointId id) { return birth_feature(id) == kOwn; }), 60);
}

TEST(LocalMap, CarriesWhatMatchingNeeds) {
  Chain w;
  MapPoint& p = w.map.edit_point(w.a[2]);
  p.normal = {0, 0, -1};
  p.reference_distance = 2.5F;
  p.reference_scale = 1.44F;
  p.descriptor = {1, 2, 3, 4};
  const auto candidates = local_map_candidates({w.a[2]}, w.map);
  const Candidate& c = candidates.at(2);
  EXPECT_EQ(c.id, w.a[2]);
  EXPECT_EQ(c.position, w.map.point(w.a[2])->position);
  EXPECT_EQ(c.normal, Eigen::Vector3f(0, 0, -1));
  EXPECT_EQ(c.reference_distance, 2.5F);
  EXPECT_EQ(c.reference_scale, 1.44F);
  EXPECT_LT(c.angle, 0);  // a map point has none
  EXPECT_EQ(c.descriptor, (Descriptor{1, 2, 3, 4}));
}

TEST(LocalMap, LeavesOutWhatWasRemovedOrFused) {
  Chain w;
  w.map.remove_point(w.a[0]);
  w.map.fuse(w.a[1], w.a[2]);
  EXPECT_EQ(ids_of(local_map_candidates({w.a[2]}, w.map)), (std::vector<PointId>{w.a[2], w.a[3], w.a[4]} + w.b));
}

}  // namespace
}  // namespace dkb
