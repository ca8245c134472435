// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/point_creation.h"

#include <gtest/gtest.h>

#include <functional>

#include "dkb/mapping/test_map.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Two keyframes that share 100 points of one scene (so that they are neighbours) and see a second scene that has no
// points in the map yet.
class PointCreation : public ::testing::Test {
 protected:
  void build(const Rigid3& second, const ViewOptions& options = {.depth_share = 0}) {
    poses = {Rigid3(), second};
    std::vector<View> views;
    for (size_t k = 0; k < 2; ++k) {
      ViewOptions o = options;
      o.seed = k + 1;
      const View known = known_scene.look(poses[k]), fresh = scene.look(poses[k], o);
      View both;
      auto features = std::make_shared<RgbdFeatures>();
      for (const View* v : {&known, &fresh}) {
        features->keypoints.insert(features->keypoints.end(), v->features->keypoints.begin(),
                                   v->features->keypoints.end());
        features->descriptors.insert(features->descriptors.end(), v->features->descriptors.begin(),
                                     v->features->descriptors.end());
        for (int shows : v->shows) {
          both.shows.push_back(v == &known ? shows : -1);
          fresh_shows[k].push_back(v == &known ? -1 : shows);
        }
      }
      both.features = features;
      views.push_back(both);
    }
    map = SceneMap(known_scene, views, poses, [&](int i) { return known_scene.points[static_cast<size_t>(i)]; }).map;
  }
  std::vector<PointId> create() { return triangulate_new_points(map, 1, scene.optics()); }

  // `change` gets the fresh features of the first keyframe, and how far what they show is from it [m].
  void change_first(const std::function<void(Keypoint&, double)>& change) {
    auto changed = std::make_shared<RgbdFeatures>(*map.keyframe(0)->features);
    for (size_t f = 0; f < changed->size(); ++f)
      if (const int shows = fresh_shows[0][f]; shows >= 0)
        change(changed->keypoints[f], scene.points[static_cast<size_t>(shows)].z());
    std::vector<Keyframe> keyframes = {*map.keyframe(0), *map.keyframe(1)};
    keyframes[0].features = changed;
    std::vector<MapPoint> points;
    for (PointId id : map.live_points()) points.push_back(*map.point(id));
    map = Map::restore(keyframes, points, {});
  }

  TestScene known_scene{200, 7}, scene{400, 8};
  std::vector<Rigid3> poses;
  std::vector<int> fresh_shows[2];  // per keyframe and feature: the point of `scene`
  Map map;
};

TEST_F(PointCreation, TriangulatesWhatBothKeyframesSee) {
  build(TestScene::camera_at({0.2, 0.05, 0}, {0.01, -0.05, 0.02}));
  const size_t before = map.point_count();
  const auto made = create();
  ASSERT_GT(made.size(), 60U);
  EXPECT_EQ(map.point_count(), before + made.size());
  for (size_t i = 0; i < made.size(); ++i) {
    if (i > 0) {
      EXPECT_LT(made[i - 1], made[i]);
    }
    const MapPoint& p = *map.point(made[i]);
    EXPECT_EQ(birth_keyframe(made[i]), 1);
    ASSERT_EQ(p.observations.size(), 2U);
    const int a = fresh_shows[0][static_cast<size_t>(p.observations[0].feature)];
    const int b = fresh_shows[1][static_cast<size_t>(p.observations[1].feature)];
    ASSERT_GE(a, 0);
    EXPECT_EQ(a, b) << "both features must show the same point";
    EXPECT_LT((p.position - scene.points[static_cast<size_t>(a)]).norm(), 1e-4);
  }
}

TEST_F(PointCreation, NoisyPointsLieNearTheirRays) {
  build(TestScene::camera_at({0.25, 0, 0}), {.pixel_noise = 0.5, .depth_share = 0, .flipped_bits = 15, .clutter = 100});
  const auto made = create();
  ASSERT_GT(made.size(), 50U);
  int far_off = 0;
  for (PointId id : made) {
    const MapPoint& p = *map.point(id);
    const int shows = fresh_shows[1][static_cast<size_t>(p.observations[1].feature)];
    ASSERT_GE(shows, 0) << "clutter must not meet";
    const Eigen::Vector3d& truth = scene.points[static_cast<size_t>(shows)];
    // One pixel over a base of 0.25 m: z^2 / (f b) = 3.5^2 / (525 * 0.25) = 9 cm, times up to 3.6 px of a coarse level.
    far_off += (p.position - truth).norm() > 0.35;
  }
  EXPECT_LE(far_off, static_cast<int>(made.size()) / 20);
}

TEST_F(PointCreation, WithoutParallaxThereIsNothingToTriangulate) {
  build(TestScene::camera_at({0, 0, 0}, {0, 0.1, 0}));  // turned on the spot
  EXPECT_TRUE(create().empty());
  build(TestScene::camera_at({0.01, 0, 0}));  // 1 cm
  EXPECT_TRUE(create().empty());
}

TEST_F(PointCreation, RaysMustMeetAtTheMinimumParallax) {
  build(TestScene::camera_at({0.025, 0, 0}));  // seen from 1.5 m and more: 0.95 degrees at most
  EXPECT_TRUE(create().empty());
}

TEST_F(PointCreation, FeaturesWithDepthAreLeftAlone) {
  build(TestScene::camera_at({0.2, 0, 0}), {.depth_share = 1});
  EXPECT_TRUE(create().empty());
}

TEST_F(PointCreation, TheDepthOfTheOtherKeyframeMustAgree) {
  // The neighbour has depths, all of them 1 m too large.
  build(TestScene::camera_at({0.2, 0, 0}));
  change_first([](Keypoint& k, double depth) { k.depth = static_cast<float>(depth + 1); });
  EXPECT_TRUE(create().empty());
}

// A wrong match over a short base meets close to the camera, before surfaces that the depth image shows.
TEST_F(PointCreation, NothingLiesBeforeTheSurfacesAround) {
  build(TestScene::camera_at({0.2, 0, 0}));
  const size_t all = create().size();
  ASSERT_GT(all, 60U);
  build(TestScene::camera_at({0.2, 0, 0}));
  change_first([](Keypoint& k, double depth) { k.lent_depth = static_cast<float>(depth - 0.2); });
  EXPECT_EQ(create().size(), all);
  build(TestScene::camera_at({0.2, 0, 0}));
  change_first([](Keypoint& k, double depth) { k.lent_depth = static_cast<float>(depth + 2); });
  EXPECT_TRUE(create().empty());
}

TEST_F(PointCreation, DescriptorsMustAgree) {
  build(TestScene::camera_at({0.2, 0, 0}), {.depth_share = 0, .flipped_bits = 100});
  EXPECT_TRUE(create().empty());
}

TEST_F(PointCreation, ASecondCallFindsNothingMore) {
  build(TestScene::camera_at({0.2, 0, 0}));
  ASSERT_FALSE(create().empty());
  EXPECT_TRUE(create().empty());
}

}  // namespace
}  // namespace dkb
