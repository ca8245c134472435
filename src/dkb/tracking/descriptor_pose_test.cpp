// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/descriptor_pose.h"

#include <gtest/gtest.h>

#include "dkb/matching/test_scene.h"

namespace dkb {
namespace {

class DescriptorPoseTest : public ::testing::Test {
 protected:
  DescriptorPoseTest() {
    for (size_t i = 0; i < scene.points.size(); ++i)
      known.push_back({make_point_id(3, static_cast<int>(i)), scene.points[i], scene.descriptors[i]});
  }
  std::optional<DescriptorPose> find(const MatchableFeatures& features, int min_matches = 20) const {
    return pose_by_descriptors(known, features, scene.camera, {}, TestScene::kScaleFactor, min_matches, {});
  }

  TestScene scene{300};
  std::vector<DescribedPoint> known;
  Rigid3 truth = TestScene::camera_at({0.3, -0.1, 0.2}, {0.05, -0.2, 0.1});
};

TEST_F(DescriptorPoseTest, NamesThePointThatEachFeatureShows) {
  const View view = scene.look(truth, {.pixel_noise = 0.5, .clutter = 100, .misplaced = 0.2});
  const auto found = find(*view.features);
  ASSERT_TRUE(found);
  EXPECT_LT(distance_between(found->cam_from_world, truth), 0.02);
  EXPECT_LT(rotation_between(found->cam_from_world, truth), 0.5);
  ASSERT_EQ(found->points.size(), view.features->size());
  int shown = 0;
  for (size_t f = 0; f < found->points.size(); ++f) {
    if (found->points[f] == kNoPoint) continue;
    ++shown;
    EXPECT_EQ(found->points[f], make_point_id(3, view.shows[f])) << "feature " << f;
  }
  EXPECT_EQ(shown, found->inliers);
}

TEST_F(DescriptorPoseTest, FeaturesThatMayLieOnMoversTakeNoPart) {
  const View view = scene.look(truth);
  std::vector<FeatureMotion> motion(view.features->size(), FeatureMotion::still);
  for (size_t f = 0; f < motion.size(); f += 2) motion[f] = FeatureMotion::on_mover;
  const auto found = find({*view.features, motion});
  ASSERT_TRUE(found);
  for (size_t f = 0; f < motion.size(); f += 2) EXPECT_EQ(found->points[f], kNoPoint);
  motion.assign(motion.size(), FeatureMotion::on_mover);
  EXPECT_FALSE(find({*view.features, motion}));
}

TEST_F(DescriptorPoseTest, NothingComesOfTooFewMatchesOrOfAnotherPlace) {
  const View view = scene.look(truth);
  const int matches = static_cast<int>(view.features->size());
  EXPECT_TRUE(find(*view.features, matches));
  EXPECT_FALSE(find(*view.features, matches + 1));
  EXPECT_FALSE(find(*TestScene(300, 99).look(truth).features));
  known.clear();
  EXPECT_FALSE(find(*view.features));
}

}  // namespace
}  // namespace dkb
