// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/optical_flow.h"

#include <gtest/gtest.h>

#include "dkb/features/fast_corners.h"
#include "dkb/features/feature_test_util.h"
#include "dkb/util/errors.h"

#ifdef DKB_TEST_OPENCV
#include <opencv2/video/tracking.hpp>
#endif

namespace dkb {
namespace {

using Motion = SquareWorld::Motion;

struct Scene {
  SquareWorld world{320, 240, 250, 8};
  ImagePyramid previous{flow_pyramid()}, current{flow_pyramid()};
  std::vector<Eigen::Vector2f> points;

  explicit Scene(const Motion& motion, double noise = 0) {
    const GreyImage first = world.render({}, noise, 1);
    previous.build(first);
    current.build(world.render(motion, noise, 2));
    std::vector<PixelCorner> corners;
    FastCornerFinder().find(first, 30, 20, corners);
    for (size_t i = 0; i < corners.size() && points.size() < 150; i += 2)
      points.emplace_back(static_cast<float>(corners[i].x) + 0.3F, static_cast<float>(corners[i].y) - 0.2F);
  }
  Eigen::Vector2f truth(const Motion& motion, const Eigen::Vector2f& p) const {
    double x = 0, y = 0;
    world.move(motion, p.x(), p.y(), x, y);
    return {static_cast<float>(x), static_cast<float>(y)};
  }
};

double median_error(const Scene& scene, const Motion& motion, const std::vector<FlowResult>& results) {
  std::vector<double> errors;
  for (size_t i = 0; i < results.size(); ++i)
    if (results[i].found) errors.push_back((results[i].position - scene.truth(motion, scene.points[i])).norm());
  EXPECT_GT(errors.size(), 0.8 * static_cast<double>(scene.points.size()));
  std::sort(errors.begin(), errors.end());
  return errors[errors.size() / 2];
}

TEST(LucasKanade, SamplesABilinearSurfaceExactly) {
  GreyImage image(40, 30);
  for (int y = 0; y < 30; ++y)
    for (int x = 0; x < 40; ++x) image(x, y) = static_cast<uint8_t>(10 + 3 * x + 2 * y);
  LkSamples samples;
  lk_sample(image, 12.25, 10.5, 5, samples, Simd::scalar);
  EXPECT_EQ(samples[2 * kLkStride + 2], 16 * (10 + 3 * 12.25 + 2 * 10.5));
  EXPECT_EQ(samples[0], 16 * (10 + 3 * 10.25 + 2 * 8.5));
}

TEST(LucasKanade, VectorKernelsEqualScalar) {
  const GreyImage image = noise_image(70, 50, 2);
  Random random(3);
  for (int trial = 0; trial < 450; ++trial) {
    const double x = random.uniform(6, 63), y = random.uniform(6, 43);
    ASSERT_TRUE(lk_fits(image, x, y, kFlowRimmed));
    alignas(32) LkSamples fast, scalar;
    lk_sample(image, x, y, kFlowRimmed, fast, best_simd());
    lk_sample(image, x, y, kFlowRimmed, scalar, Simd::scalar);
    for (int row = 0; row < kFlowRimmed; ++row)
      for (int i = 0; i < kFlowRimmed; ++i) ASSERT_EQ(fast[row * kLkStride + i], scalar[row * kLkStride + i]);
    LkTemplate reference;
    lk_make_template(fast, reference);
    lk_sample(image, y, x > 40 ? 20 : x, kFlowWindow, fast, best_simd());
    lk_sample(image, y, x > 40 ? 20 : x, kFlowWindow, scalar, Simd::scalar);
    EXPECT_EQ(lk_sums(reference, fast, best_simd()), lk_sums(reference, scalar, Simd::scalar));
  }
}

TEST(LucasKanade, SumsDoNotOverflowAtTheLargestContrast) {
  GreyImage black(60, 60, 0), stripes(60, 60, 0);
  for (int y = 0; y < 60; ++y)
    for (int x = 0; x < 60; ++x) stripes(x, y) = (x / 2) % 2 == 0 ? 255 : 0;
  alignas(32) LkSamples samples;
  LkTemplate reference;
  lk_sample(stripes, 30, 30, kFlowRimmed, samples, best_simd());
  lk_make_template(samples, reference);
  lk_sample(black, 30, 30, kFlowWindow, samples, best_simd());
  EXPECT_EQ(lk_sums(reference, samples, best_simd()), lk_sums(reference, samples, Simd::scalar));
}

TEST(OpticalFlow, FollowsShiftsOfAllSizesToAFractionOfAPixel) {
  for (const Motion& motion : {Motion{1, 0, 0.3, -0.4}, Motion{1, 0, 4.7, 2.2}, Motion{1, 0, -13.4, 9.8}}) {
    const Scene scene(motion);
    EXPECT_LT(median_error(scene, motion, track_flow(scene.previous, scene.current, scene.points)), 0.03);
  }
}

TEST(OpticalFlow, FollowsUnderNoiseAndSmallTurns) {
  const Motion motion = Motion::turned(0.03, 1.02, 3.3, -1.8);
  const Scene scene(motion, 2.0);
  EXPECT_LT(median_error(scene, motion, track_flow(scene.previous, scene.current, scene.points)), 0.12);
}

TEST(OpticalFlow, VectorKernelsEqualScalarBitForBit) {
  const Scene scene(Motion{1, 0, 4.7, 2.2}, 2.0);
  const std::vector<FlowResult> fast = track_flow(scene.previous, scene.current, scene.points);
  const std::vector<FlowResult> scalar = track_flow(scene.previous, scene.current, scene.points, Simd::scalar);
  for (size_t i = 0; i < fast.size(); ++i) {
    EXPECT_EQ(fast[i].position, scalar[i].position);
    EXPECT_EQ(fast[i].found, scalar[i].found);
  }
}

TEST(OpticalFlow, FlatWindowsAndPointsOutsideAreNotFound) {
  ImagePyramid flat(flow_pyramid());
  flat.build(GreyImage(320, 240, 100));
  const std::vector<Eigen::Vector2f> points = {{100, 100}, {-5, 20}, {3, 3}, {500, 20}, {NAN, 20}};
  for (const FlowResult& result : track_flow(flat, flat, points)) EXPECT_FALSE(result.found);
}

TEST(OpticalFlow, CornersAreFollowedAndEdgesAreNot) {
  GreyImage image(320, 240, 50);
  for (int y = 100; y < 240; ++y)
    for (int x = 150; x < 320; ++x) image(x, y) = 200;
  ImagePyramid pyramid(flow_pyramid());
  pyramid.build(image);
  const std::vector<Eigen::Vector2f> points = {{150, 100}, {150, 180}};
  const std::vector<FlowResult> results = track_flow(pyramid, pyramid, points);
  EXPECT_TRUE(results[0].found);
  EXPECT_FALSE(results[1].found);
}

TEST(OpticalFlow, RefusesBadInput) {
  ImagePyramid a, b;
  a.build(GreyImage(100, 80));
  b.build(GreyImage(100, 90));
  const std::vector<Eigen::Vector2f> points(2, Eigen::Vector2f(50, 40));
  EXPECT_THROW(track_flow(a, b, points), InputError);
}

#ifdef DKB_TEST_OPENCV
TEST(OpticalFlow, AgreesWithOpenCvs) {
  for (const Motion& motion : {Motion{1, 0, 1.3, -0.6}, Motion::turned(0.02, 1.0, 5.5, 3.1)}) {
    const Scene scene(motion, 1.0);
    const auto wrap = [](const GreyImage& image) {
      return cv::Mat(image.height(), image.width(), CV_8U, const_cast<uint8_t*>(image.data()));
    };
    std::vector<cv::Point2f> from, to;
    for (const Eigen::Vector2f& p : scene.points) from.emplace_back(p.x(), p.y());
    std::vector<uint8_t> status;
    std::vector<float> error;
    cv::calcOpticalFlowPyrLK(wrap(scene.previous.level(0)), wrap(scene.current.level(0)), from, to, status, error,
                             {11, 11}, 3);
    const std::vector<FlowResult> results = track_flow(scene.previous, scene.current, scene.points);
    std::vector<float> differences;
    for (size_t i = 0; i < results.size(); ++i)
      if (results[i].found && status[i] != 0)
        differences.push_back((results[i].position - Eigen::Vector2f(to[i].x, to[i].y)).norm());
    ASSERT_GT(differences.size(), 0.85 * static_cast<double>(scene.points.size()));
    std::sort(differences.begin(), differences.end());
    EXPECT_LT(differences[differences.size() / 2], 0.03F);
    EXPECT_LT(differences[differences.size() * 9 / 10], 0.15F);
  }
}
#endif

}  // namespace
}  // namespace dkb
