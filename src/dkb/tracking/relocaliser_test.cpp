// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/relocaliser.h"

#include <gtest/gtest.h>

#include "dkb/matching/test_scene.h"

namespace dkb {
namespace {

const ViewOptions kNoisy{
    .pixel_noise = 0.5, .depth_noise = 0.01, .depth_share = 0.8, .flipped_bits = 20, .clutter = 200, .misplaced = 0.1};

bool ignores_none(PointId) {
  return false;
}

// Says the same of every place.
class FixedAppearance final : public PointAppearance {
 public:
  explicit FixedAppearance(std::optional<bool> answer) : answer_(answer) {}
  std::optional<bool> same(const Eigen::Vector2d&, double, int, const Descriptor&) override { return answer_; }

 private:
  std::optional<bool> answer_;
};

class RelocaliserTest : public ::testing::Test {
 protected:
  Relocaliser relocaliser() const { return {camera, {}, TestScene::kScaleFactor, TestScene::kLevels, 1}; }
  // Keyframes in a row that see the scene from its own origin, set down at `scene_from_world` in the map's world.
  void map_scene(const TestScene& scene, const Rigid3& scene_from_world = {}) {
    const KeyframeId first = map.keyframe_count();
    std::vector<PointId> named(scene.points.size(), kNoPoint);
    for (int n = 0; n < 4; ++n) {
      const Rigid3 cam_from_scene = TestScene::camera_at({0.15 * n - 0.2, 0, 0});
      const View view = scene.look(cam_from_scene);
      Keyframe k;
      k.id = first + n;
      k.parent = n == 0 ? kNoKeyframe : first;
      k.features = view.features;
      k.cam_from_world = cam_from_scene * scene_from_world;
      k.points.assign(view.features->size(), kNoPoint);
      for (size_t f = 0; f < k.points.size(); ++f) k.points[f] = named[static_cast<size_t>(view.shows[f])];
      map.add_keyframe(k);
      for (size_t f = 0; f < k.points.size(); ++f) {
        const auto shown = static_cast<size_t>(view.shows[f]);
        if (named[shown] != kNoPoint) continue;
        MapPoint p;
        p.id = named[shown] = make_point_id(k.id, static_cast<int>(f));
        p.position = scene_from_world.inverse() * scene.points[shown];
        p.reference_distance = static_cast<float>((cam_from_scene * scene.points[shown]).norm());
        p.reference_scale = static_cast<float>(std::pow(TestScene::kScaleFactor, view.features->keypoints[f].octave));
        p.descriptor = scene.descriptors[shown];
        map.add_point(p);
        map.observe(p.id, k.id, static_cast<int>(f));
      }
      map.update_covisibility(k.id, 15);
    }
  }

  CameraModel camera;
  Map map;
};

TEST_F(RelocaliserTest, FindsTheCameraWithoutAnyIdeaOfItsPlace) {
  const TestScene scene(700);
  map_scene(scene);
  for (int n = 0; n < 6; ++n) {
    const Rigid3 truth = TestScene::camera_at({0.1 * n - 0.2, 0.05, 0.1}, {0, 0.04 * n, 0.1});
    ViewOptions noisy = kNoisy;
    noisy.seed = static_cast<uint64_t>(n) + 1;
    const auto found = relocaliser().find(map, *scene.look(truth, noisy).features, ignores_none, nullptr);
    ASSERT_TRUE(found) << n;
    EXPECT_TRUE(found->verified);
    EXPECT_LT(distance_between(found->cam_from_world, truth), 0.015);
    EXPECT_LT(rotation_between(found->cam_from_world, truth), 0.3);
    EXPECT_GT(found->found, 0.5 * found->well_known);
  }
}

TEST_F(RelocaliserTest, AnotherPlaceIsNotFound) {
  map_scene(TestScene(700));
  EXPECT_FALSE(relocaliser().find(map, *TestScene(700, 99).look({}).features, ignores_none, nullptr));
  EXPECT_FALSE(relocaliser().find(map, RgbdFeatures(), ignores_none, nullptr)) << "nor darkness";
  EXPECT_FALSE(relocaliser().find(Map(), *TestScene(700).look({}).features, ignores_none, nullptr))
      << "nor anything in no map";
}

TEST_F(RelocaliserTest, TwoPlacesThatExplainAFrameEquallyWellAreWorthNothing) {
  const TestScene scene(700);
  map_scene(scene);
  ASSERT_TRUE(relocaliser().find(map, *scene.look({}).features, ignores_none, nullptr));
  map_scene(scene, TestScene::camera_at({20, 0, 0}));
  const RgbdFeatures features = *scene.look({}).features;
  const auto proposals = relocaliser().propose(map, features, ignores_none, nullptr);
  ASSERT_EQ(proposals.size(), 2U);
  EXPECT_TRUE(proposals[0].verified && proposals[1].verified);
  EXPECT_FALSE(relocaliser().find(map, features, ignores_none, nullptr)) << "a guess is no pose";
}

TEST_F(RelocaliserTest, FeaturesOnMoversDoNotVote) {
  const TestScene scene(700);
  map_scene(scene);
  const RgbdFeatures features = *scene.look({}).features;
  std::vector<FeatureMotion> motion(features.size(), FeatureMotion::on_mover);
  EXPECT_FALSE(relocaliser().find(map, {features, motion}, ignores_none, nullptr));
  for (size_t f = 0; f < features.size(); f += 2) motion[f] = FeatureMotion::still;
  const auto found = relocaliser().find(map, {features, motion}, ignores_none, nullptr);
  ASSERT_TRUE(found);
  for (size_t f = 1; f < features.size(); f += 2) EXPECT_EQ(found->points[f], kNoPoint);
}

TEST_F(RelocaliserTest, IgnoredPointsAreNotMatched) {
  const TestScene scene(700);
  map_scene(scene);
  const auto features = scene.look({}).features;
  const auto found = relocaliser().find(
      map, *features, [](PointId id) { return birth_feature(id) % 2 == 0; }, nullptr);
  ASSERT_TRUE(found);
  for (PointId p : found->points)
    if (p != kNoPoint) {
      EXPECT_EQ(birth_feature(p) % 2, 1);
    }
  EXPECT_FALSE(relocaliser().find(
      map, *features, [](PointId) { return true; }, nullptr));
}

TEST_F(RelocaliserTest, APlaceThatLooksDifferentWhereNothingMatchedIsNotVerified) {
  const TestScene scene(700);
  map_scene(scene);
  RgbdFeatures features = *scene.look({}).features;
  for (size_t f = 0; f < features.size(); f += 2) features.descriptors[f] = {f, ~f, f * f, ~(f * f)};
  FixedAppearance looks_alike(true), looks_different(false), unknown(std::nullopt);
  const auto same = relocaliser().find(map, features, ignores_none, &looks_alike);
  ASSERT_TRUE(same);
  EXPECT_EQ(same->similarity(), 1);
  EXPECT_FALSE(relocaliser().find(map, features, ignores_none, &looks_different));
  const auto other = relocaliser().propose(map, features, ignores_none, &looks_different);
  ASSERT_FALSE(other.empty());
  EXPECT_NEAR(other[0].similarity(), 0.5, 0.1);
  EXPECT_TRUE(relocaliser().find(map, features, ignores_none, &unknown));
}

}  // namespace
}  // namespace dkb
