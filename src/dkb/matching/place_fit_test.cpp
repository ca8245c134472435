// SPDX-License-Identifier: Apache-2.0
#include "dkb/matching/place_fit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dkb/matching/test_scene.h"

namespace dkb {
namespace {

class PlaceFitTest : public ::testing::Test {
 protected:
  PlaceFitTest() {
    for (size_t i = 0; i < scene.points.size(); ++i) {
      Candidate& k = known.emplace_back();
      k.id = make_point_id(3, static_cast<int>(i));
      k.position = scene.points[i];
      k.normal.setZero();
      k.reference_distance = static_cast<float>(scene.points[i].norm());
      const int octave = scene.octave(static_cast<int>(i), scene.points[i].norm());
      k.reference_scale = static_cast<float>(std::pow(TestScene::kScaleFactor, octave));
      k.descriptor = scene.descriptors[i];
    }
  }
  std::optional<PlaceFit> by_descriptors(const MatchableFeatures& features, int min_matches = 20) const {
    return fit_by_descriptors(known, features, optics, min_matches, {});
  }
  std::optional<PlaceFit> by_projection(const MatchableFeatures& features, const Rigid3& expected) const {
    const float radii[] = {20, 4};
    return fit_by_projection(known, features, optics, expected, radii);
  }
  // Every feature that shows something shows what the view says; returns how many do.
  static int shown(const PlaceFit& fit, const View& view) {
    EXPECT_EQ(fit.points.size(), view.features->size());
    int shown = 0;
    for (size_t f = 0; f < fit.points.size(); ++f) {
      if (fit.points[f] == kNoPoint) continue;
      ++shown;
      EXPECT_EQ(fit.points[f], make_point_id(3, view.shows[f])) << "feature " << f;
    }
    return shown;
  }

  TestScene scene{300};
  Optics optics = scene.optics();
  std::vector<Candidate> known;
  Rigid3 truth = TestScene::camera_at({0.3, -0.1, 0.2}, {0.05, -0.2, 0.1});
};

TEST_F(PlaceFitTest, DescriptorsAloneTellWhereTheCameraIs) {
  const View view = scene.look(truth, {.pixel_noise = 0.5, .clutter = 100, .misplaced = 0.2});
  const auto found = by_descriptors(*view.features);
  ASSERT_TRUE(found);
  EXPECT_LT(distance_between(found->cam_from_world, truth), 0.02);
  EXPECT_LT(rotation_between(found->cam_from_world, truth), 0.5);
  EXPECT_EQ(shown(*found, view), found->inliers);
}

TEST_F(PlaceFitTest, NearAnExpectedPoseThePointsTellExactly) {
  const View view = scene.look(truth, {.pixel_noise = 0.5, .clutter = 100});
  const Rigid3 expected = TestScene::camera_at({0.01, 0, 0.01}, {0, 0.01, 0}) * truth;
  const auto found = by_projection(*view.features, expected);
  ASSERT_TRUE(found);
  EXPECT_LT(distance_between(found->cam_from_world, truth), 0.01);
  EXPECT_GT(found->covariance.trace(), 0);
  EXPECT_EQ(shown(*found, view), found->inliers);
  EXPECT_FALSE(by_projection(*view.features, TestScene::camera_at({0, 0, 0}, {0, 0.4, 0}) * truth))
      << "nothing lies within the radius";
}

TEST_F(PlaceFitTest, TellsWhichPointsAreFoundMissedAndOutOfView) {
  const View view = scene.look(truth);
  RgbdFeatures features = *view.features;
  std::vector<Sighting> expected(known.size(), Sighting::out_of_view);
  for (size_t f = 0; f < features.size(); ++f) {
    expected[static_cast<size_t>(view.shows[f])] = f % 2 == 0 ? Sighting::missed : Sighting::found;
    if (f % 2 == 0) features.descriptors[f] = {f, ~f, f * f, ~(f * f)};
  }
  const auto found = by_projection(features, truth);
  ASSERT_TRUE(found);
  ASSERT_EQ(found->sightings.size(), known.size());
  int other = 0;
  for (size_t i = 0; i < known.size(); ++i) other += found->sightings[i] != expected[i];
  EXPECT_LE(other, static_cast<int>(known.size()) / 20) << "points at the border of the image, and of the view's angle";
  EXPECT_EQ(std::count(found->sightings.begin(), found->sightings.end(), Sighting::found), found->inliers);
}

TEST_F(PlaceFitTest, FeaturesThatMayLieOnMoversTakeNoPart) {
  const View view = scene.look(truth);
  std::vector<FeatureMotion> motion(view.features->size(), FeatureMotion::still);
  for (size_t f = 0; f < motion.size(); f += 2) motion[f] = FeatureMotion::on_mover;
  for (const auto& found : {by_descriptors({*view.features, motion}), by_projection({*view.features, motion}, truth)}) {
    ASSERT_TRUE(found);
    for (size_t f = 0; f < motion.size(); f += 2) EXPECT_EQ(found->points[f], kNoPoint);
  }
  motion.assign(motion.size(), FeatureMotion::on_mover);
  EXPECT_FALSE(by_descriptors({*view.features, motion}));
  EXPECT_FALSE(by_projection({*view.features, motion}, truth));
}

TEST_F(PlaceFitTest, NothingComesOfTooFewMatchesOrOfAnotherPlace) {
  const View view = scene.look(truth);
  const int matches = static_cast<int>(view.features->size());
  EXPECT_TRUE(by_descriptors(*view.features, matches));
  EXPECT_FALSE(by_descriptors(*view.features, matches + 1));
  EXPECT_FALSE(by_descriptors(*TestScene(300, 99).look(truth).features));
  EXPECT_FALSE(by_projection(*TestScene(300, 99).look(truth).features, truth));
  known.clear();
  EXPECT_FALSE(by_descriptors(*view.features));
  EXPECT_FALSE(by_projection(*view.features, truth));
}

}  // namespace
}  // namespace dkb
