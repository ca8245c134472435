// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/relocaliser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "dkb/matching/test_scene.h"
#include "dkb/tracking/tracker_test_fixture.h"

namespace dkb {
namespace {

// Says the same of every place.
class FixedAppearance final : public PointAppearance {
 public:
  explicit FixedAppearance(Look answer) : answer_(answer) {}
  Look look(const Eigen::Vector2d&, double, int, const Descriptor&) override { return answer_; }

 private:
  Look answer_;
};

class RelocaliserTest : public ::testing::Test {
 protected:
  Relocaliser relocaliser() const { return {{camera, {}, TestScene::kScaleFactor, TestScene::kLevels}, 1}; }
  std::optional<PoseProposal> find(const MatchableFeatures& features, PointAppearance* appearance = nullptr) const {
    PlaceEvidence evidence;
    return relocaliser().find(map, features, {}, appearance, evidence);
  }
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
    FixedAppearance unmatched(Look::other);
    const auto found = find(*scene.look(truth, noisy).features, &unmatched);
    ASSERT_TRUE(found) << n;
    EXPECT_TRUE(found->verified);
    EXPECT_LT(distance_between(found->fit.cam_from_world, truth), 0.015);
    EXPECT_LT(rotation_between(found->fit.cam_from_world, truth), 0.3);
    const auto matched = std::count_if(found->looks.begin(), found->looks.end(), [](PointLook l) { return l.same; });
    EXPECT_GT(static_cast<double>(matched), 0.5 * static_cast<double>(found->looks.size()));
  }
}

TEST_F(RelocaliserTest, AnotherPlaceIsNotFound) {
  map_scene(TestScene(700));
  EXPECT_FALSE(find(*TestScene(700, 99).look({}).features));
  EXPECT_FALSE(find(RgbdFeatures())) << "nor darkness";
  map = Map();
  EXPECT_FALSE(find(*TestScene(700).look({}).features)) << "nor anything in no map";
}

TEST_F(RelocaliserTest, TwoPlacesThatExplainAFrameEquallyWellAreAmbiguous) {
  const TestScene scene(700);
  map_scene(scene);
  const auto alone = find(*scene.look({}).features);
  ASSERT_TRUE(alone);
  EXPECT_FALSE(alone->ambiguous);
  map_scene(scene, TestScene::camera_at({20, 0, 0}));
  const auto found = find(*scene.look({}).features);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->ambiguous) << "a guess is no pose";
}

TEST_F(RelocaliserTest, FeaturesOnMoversDoNotVote) {
  const TestScene scene(700);
  map_scene(scene);
  const RgbdFeatures features = *scene.look({}).features;
  std::vector<FeatureMotion> motion(features.size(), FeatureMotion::on_mover);
  EXPECT_FALSE(find({features, motion}));
  for (size_t f = 0; f < features.size(); f += 2) motion[f] = FeatureMotion::still;
  const auto found = find({features, motion});
  ASSERT_TRUE(found);
  for (size_t f = 1; f < features.size(); f += 2) EXPECT_EQ(found->fit.points[f], kNoPoint);
}

TEST_F(RelocaliserTest, IgnoredPointsAreNotMatched) {
  const TestScene scene(700);
  map_scene(scene);
  const auto features = scene.look({}).features;
  PlaceEvidence evidence;
  const std::vector<PointId> all = map.live_points();
  std::vector<PointId> even = all;
  std::erase_if(even, [](PointId id) { return birth_feature(id) % 2 != 0; });
  const auto found = relocaliser().find(map, *features, even, nullptr, evidence);
  ASSERT_TRUE(found);
  for (PointId p : found->fit.points)
    if (p != kNoPoint) {
      EXPECT_EQ(birth_feature(p) % 2, 1);
    }
  EXPECT_FALSE(relocaliser().find(map, *features, all, nullptr, evidence));
}

TEST_F(RelocaliserTest, TheImageTellsHowPointsLookThatNoFeatureMatched) {
  const TestScene scene(700);
  map_scene(scene);
  RgbdFeatures features = *scene.look({}).features;
  for (size_t f = 0; f < features.size(); f += 2) features.descriptors[f] = {f, ~f, f * f, ~(f * f)};
  const auto looks_by = [&](Look answer) {
    FixedAppearance appearance(answer);
    const auto found = find(features, &appearance);
    EXPECT_TRUE(found && found->verified);
    const auto same = std::count_if(found->looks.begin(), found->looks.end(), [](PointLook l) { return l.same; });
    return std::pair(same, static_cast<long>(found->looks.size()) - same);
  };
  const auto [matched, none] = looks_by(Look::unknown);
  EXPECT_GT(matched, 40);
  EXPECT_EQ(none, 0);
  const auto [still, different] = looks_by(Look::other);
  EXPECT_EQ(still, matched);
  EXPECT_NEAR(static_cast<double>(different) / static_cast<double>(matched), 1, 0.3);
  EXPECT_EQ(looks_by(Look::same), std::pair(matched + different, 0L));
}

// A room with the same furniture: but for one corner of it everything is as the map has it.
TEST_F(RelocaliserTest, ALookAlikeIsAmbiguousUntilTheViewsDecide) {
  TestScene scene(700);
  for (size_t i = 0; i < scene.points.size(); ++i) {  // things of five points each
    const Eigen::Vector3d thing = scene.points[i - i % 5];
    scene.points[i] = ((thing / 0.3).array().floor() + 0.2) * 0.3;
    scene.points[i].x() += 0.04 * static_cast<double>(i % 5);
  }
  map_scene(scene);
  auto seen = std::make_shared<RgbdFeatures>(*scene.look({}).features);
  const auto as_it_was = std::make_shared<RgbdFeatures>(*seen);
  for (size_t f = 0; f < seen->size(); ++f)
    if (seen->keypoints[f].pixel.x() < 120) seen->descriptors[f] = {f, ~f, f * f, ~(f * f)};
  FixedAppearance different(Look::other);
  const auto found = find(*seen, &different);
  ASSERT_TRUE(found && found->verified);
  EXPECT_LT(found->log_odds, 0);

  Tracker tracker({camera, {}, TestScene::kScaleFactor, TestScene::kLevels}, {}, 1);
  tracker.take_view(map.snapshot());
  tracker.reset_motion();
  FrameIndex index = 0;
  const auto track = [&](const std::shared_ptr<const RgbdFeatures>& features) {
    const FrameIndex i = index++;
    return tracker.track({.index = i,
                          .timestamp = static_cast<double>(i) * kFrameTime,
                          .features = FakeFeatures(features),
                          .appearance = &different,
                          .may_start_map = false});
  };
  for (int i = 0; i < 5; ++i) {
    const TrackedFrame frame = track(seen);
    EXPECT_EQ(frame.state, TrackingState::lost);
    EXPECT_TRUE(frame.ambiguous);
  }
  int views = 0;
  while (track(as_it_was).state == TrackingState::lost && views < 20) ++views;
  EXPECT_GT(views, 1) << "what was seen before is not forgotten at once";
  EXPECT_LT(views, 10);
}

}  // namespace
}  // namespace dkb
