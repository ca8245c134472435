// SPDX-License-Identifier: Apache-2.0
#include "dkb/comparison/dynamic_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

namespace dkb {
namespace {

CameraModel test_camera() {
  CameraModel camera;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

const std::vector<Detection> kWholeImage = {{"person", {0, 0, 640, 480}, 1}};

// A corner now at (x, y), before at (320, 240) with that depth then.
FilterFeature moved_to(double x, double y, double previous_depth) {
  FilterFeature f;
  f.image_pixel = f.pixel = {x, y};
  f.flowed = true;
  f.previous_pixel = {320, 240};
  f.previous_depth = previous_depth;
  return f;
}

FilterFeature still_at(double x, double y, double depth) {
  FilterFeature f;
  f.image_pixel = f.pixel = {x, y};
  f.depth = depth;
  f.previous_pixel = {0, 0};
  return f;
}

std::vector<uint8_t> paper(const std::vector<FilterFeature>& features, const Rigid3& motion,
                           const PaperFilterOptions& options = {}) {
  return paper_filter(features, kWholeImage, test_camera(), motion, options);
}
std::vector<uint8_t> epipolar(const std::vector<FilterFeature>& features, const Rigid3& motion) {
  return epipolar_filter(features, kWholeImage, test_camera(), motion);
}
Rigid3 shift(double x, double y, double z) {
  return {Eigen::Quaterniond::Identity(), {x, y, z}};
}

TEST(DynamicFilter, AFeatureBelongsToTheSmallestBoxAroundIt) {
  const std::vector<Detection> boxes = {{"person", {0, 0, 100, 100}, 1}, {"dog", {40, 40, 20, 20}, 1}};
  const std::vector<FilterFeature> features = {still_at(10, 10, 1), still_at(50, 50, 1), still_at(200, 10, 1),
                                               still_at(100, 50, 1)};
  EXPECT_EQ(box_of_each(features, boxes), (std::vector<int>{0, 1, -1, -1}));
  EXPECT_EQ(box_of_each(features, {}), (std::vector<int>{-1, -1, -1, -1}));
}

TEST(DynamicFilter, FlowIsMeasuredAgainstTheCamerasOwnMotion) {
  // A point at 2 m, camera 0.1 m to the right: 500 * 0.1 / 2 = 25 px to the left is what a still point does.
  const Rigid3 motion = shift(-0.1, 0, 0);
  EXPECT_EQ(paper({moved_to(295.9, 240, 2), moved_to(296.1, 240, 2), moved_to(295, 241.1, 2), moved_to(295, 239.1, 2)},
                  motion),
            (std::vector<uint8_t>{0, 1, 1, 0}));
}

TEST(DynamicFilter, RawFlowCallsEverythingDynamicWhenTheCameraMoves) {
  PaperFilterOptions raw;
  raw.compensate = false;
  EXPECT_EQ(paper({moved_to(295, 240, 2), moved_to(320.9, 240, 2)}, shift(-0.1, 0, 0), raw),
            (std::vector<uint8_t>{1, 0}));
}

TEST(DynamicFilter, WithoutDepthTheEpipolarLineDecides) {
  // Sideways motion: horizontal lines; a point may be anywhere along its own.
  EXPECT_EQ(paper({moved_to(280, 240.9, 0), moved_to(280, 241.1, 0)}, shift(-0.1, 0, 0)), (std::vector<uint8_t>{0, 1}));
}

TEST(DynamicFilter, ThePapersFilterLooksOnlyIntoBoxes) {
  const std::vector<FilterFeature> features = {moved_to(400, 240, 2)};
  EXPECT_EQ(paper_filter(features, {}, test_camera(), Rigid3(), {}), (std::vector<uint8_t>{0}));
  EXPECT_EQ(paper(features, Rigid3()), (std::vector<uint8_t>{1}));
}

TEST(DynamicFilter, TheDepthTestIsTakenOverWhatFlowLeaves) {
  std::vector<FilterFeature> features;
  for (int i = 0; i < 5; ++i) features.push_back(still_at(100 + i, 100, 2));
  features.push_back(still_at(110, 100, 4));  // th^2 = 5
  features.push_back(still_at(120, 100, 0));  // no depth: no say
  EXPECT_EQ(paper(features, Rigid3()), (std::vector<uint8_t>{0, 0, 0, 0, 0, 1, 0}));
  // Another one at 4 m that flow has removed already would have made th^2 = 2.5.
  FilterFeature moving = moved_to(400, 240, 4);
  moving.depth = 4;
  features.push_back(moving);
  EXPECT_EQ(paper(features, Rigid3()), (std::vector<uint8_t>{0, 0, 0, 0, 0, 1, 0, 1}));
}

TEST(DynamicFilter, PointsBehindTheCameraSayNothing) {
  EXPECT_EQ(paper({moved_to(320, 240, 2)}, shift(0, 0, -3)), (std::vector<uint8_t>{0}));
}

TEST(DynamicFilter, EpipolarLinesOfSidewaysMotionAreRows) {
  EXPECT_EQ(epipolar({moved_to(200, 240.9, 2), moved_to(200, 241.1, 2), moved_to(320, 240, 2)}, shift(-0.1, 0, 0)),
            (std::vector<uint8_t>{0, 1, 0}));
}

TEST(DynamicFilter, EpipolarLinesOfForwardMotionLeaveTheCentre) {
  FilterFeature along = moved_to(430, 240, 2), across = moved_to(430, 242, 2);
  along.previous_pixel = across.previous_pixel = {420, 240};
  EXPECT_EQ(epipolar({along, across}, shift(0, 0, -0.1)), (std::vector<uint8_t>{0, 1}));
}

TEST(DynamicFilter, ARotationMovesTheEpipolarLine) {
  // 0.02 rad about the optical axis and a step to the right: (420, 240) turns to (419.98, 242).
  const Rigid3 motion(Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitZ())), {-0.1, 0, 0});
  FilterFeature follows = moved_to(400, 242, 2), stays = moved_to(400, 240, 2);
  follows.previous_pixel = stays.previous_pixel = {420, 240};
  EXPECT_EQ(epipolar({follows, stays}, motion), (std::vector<uint8_t>{0, 1}));
}

TEST(DynamicFilter, WithoutTranslationThereAreNoEpipolarLines) {
  EXPECT_EQ(epipolar({moved_to(500, 400, 2)}, Rigid3()), (std::vector<uint8_t>{0}));
  FilterFeature unknown = moved_to(500, 400, 2);
  unknown.flowed = false;
  EXPECT_EQ(epipolar({unknown}, shift(-0.1, 0, 0)), (std::vector<uint8_t>{0}));
}

TEST(DynamicFilter, WhatStandsBeforeAKnownSurfaceIsDynamic) {
  DepthImage depth(640, 480, 2.0f);
  const std::vector<Eigen::Vector3d> seen = {{0, 0, 3}};  // lands on (320, 240), where 2 m is seen now
  const std::vector<FilterFeature> features = {still_at(325, 240, 2.1), still_at(325, 240, 2.5), still_at(336, 240, 2),
                                               still_at(320, 254, 0)};
  EXPECT_EQ(multiview_filter(features, seen, test_camera(), depth), (std::vector<uint8_t>{1, 0, 0, 1}));
}

TEST(DynamicFilter, SurfacesAtTheirOldPlaceAndUnknownOnesAreStill) {
  DepthImage depth(640, 480, 2.7f);
  const std::vector<FilterFeature> features = {still_at(320, 240, 2.7)};
  const auto dynamic = [&](const Eigen::Vector3d& seen) {
    return multiview_filter(features, std::vector<Eigen::Vector3d>{seen}, test_camera(), depth).at(0);
  };
  EXPECT_EQ(dynamic({0, 0, 3}), 0);     // 0.3 m
  EXPECT_EQ(dynamic({0, 0, 3.2}), 1);   // 0.5 m
  EXPECT_EQ(dynamic({0, 0, 0.05}), 0);  // too near to project
  EXPECT_EQ(dynamic({9, 0, 3}), 0);     // outside the image
  depth = DepthImage(640, 480);
  EXPECT_EQ(dynamic({0, 0, 3.2}), 0);  // no depth
}

// `near` times 2 m and `far` times 4 m: the far ones are (near / far)^0.5 sigma from the mean, and s = near / far.
std::vector<double> two_depths(size_t near, size_t far) {
  std::vector<double> depths(near, 2.0);
  depths.insert(depths.end(), far, 4.0);
  return depths;
}

int dynamic_count(const std::vector<double>& depths) {
  const auto verdict = depth_test(depths);
  return std::accumulate(verdict.begin(), verdict.end(), 0);
}

TEST(PaperFilter, MeanAndSigmaAreThoseOfEquations10And11) {
  const DepthSpread s = depth_spread(std::vector<double>{1, 2, 3, 4, 6});
  ASSERT_TRUE(s.usable);
  EXPECT_NEAR(s.mean, 3.2, 1e-12);               // 16 / 5
  EXPECT_NEAR(s.sigma, std::sqrt(2.96), 1e-12);  // (4.84 + 1.44 + 0.04 + 0.64 + 7.84) / 5
}

TEST(PaperFilter, TheSpreadRatioIsTakenAboutTheMean) {
  const DepthSpread s = depth_spread(std::vector<double>{1, 2, 3, 4, 6});
  // Above 3.2: 0.8, 2.8: (0.64 + 7.84) / 2 = 4.24; below: 2.2, 1.2, 0.2: (4.84 + 1.44 + 0.04) / 3 = 6.32 / 3.
  EXPECT_NEAR(s.ratio, std::sqrt(4.24 / (6.32 / 3)), 1e-12);
  EXPECT_EQ(s.delta, 2.8);
}

TEST(PaperFilter, ASkewedBoxGetsTheWideThreshold) {
  const DepthSpread s = depth_spread(two_depths(10, 1));
  EXPECT_NEAR(s.ratio, 10, 1e-9);
  EXPECT_EQ(s.delta, 9.0);
  EXPECT_NEAR(depth_spread(two_depths(7, 1)).ratio, 7, 1e-9);
  EXPECT_EQ(depth_spread(two_depths(7, 1)).delta, 2.8);
}

TEST(PaperFilter, DepthsBeyondDeltaAreDynamic) {
  EXPECT_EQ(dynamic_count(two_depths(5, 1)), 1);   // th^2 = 5 > 2.8
  EXPECT_EQ(dynamic_count(two_depths(5, 2)), 0);   // th^2 = 2.5
  EXPECT_EQ(dynamic_count(two_depths(17, 2)), 0);  // s = 8.5, so th^2 = 8.5 meets 9
  EXPECT_EQ(dynamic_count(two_depths(10, 1)), 1);  // s = 10, th^2 = 10 > 9
  EXPECT_EQ(depth_test(two_depths(5, 1)).back(), 1);
}

TEST(PaperFilter, TheMinorityIsDynamicEvenWhenItIsTheBackground) {
  std::vector<double> person_filling_the_box(30, 1.5);
  person_filling_the_box.insert(person_filling_the_box.end(), 5, 4.0);  // th^2 = 6, s = 6
  const auto verdict = depth_test(person_filling_the_box);
  EXPECT_EQ(verdict.front(), 0);
  EXPECT_EQ(verdict.back(), 1);
}

TEST(PaperFilter, FewOrEqualDepthsSayNothing) {
  EXPECT_FALSE(depth_spread(std::vector<double>{1, 1, 1, 9}).usable);
  EXPECT_FALSE(depth_spread(std::vector<double>(20, 2.0)).usable);
  EXPECT_FALSE(depth_spread({}).usable);
  EXPECT_EQ(dynamic_count({1, 1, 1, 9}), 0);
  EXPECT_EQ(dynamic_count(std::vector<double>(20, 2.0)), 0);
  EXPECT_TRUE(depth_test({}).empty());
}

}  // namespace
}  // namespace dkb
