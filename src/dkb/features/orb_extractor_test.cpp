// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/orb_extractor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "dkb/features/feature_test_util.h"
#include "dkb/features/orientation.h"
#include "dkb/features/subpixel.h"
#include "dkb/util/errors.h"

#ifdef DKB_TEST_OPENCV
#include <opencv2/features2d.hpp>
#include <opencv2/imgproc.hpp>
#endif

namespace dkb {
namespace {

using Motion = SquareWorld::Motion;
constexpr double kDegree = std::numbers::pi / 180.0;

SquareWorld test_world(uint64_t seed) {
  return SquareWorld(640, 480, 900, seed);
}

struct MatchQuality {
  size_t in_view = 0, correct = 0;  // corners of the first image that the second one shows; with a correct best match
  double squared_error = 0;         // [level px^2] of the correct ones, both axes
  double share() const { return static_cast<double>(correct) / static_cast<double>(in_view); }
  double rms() const { return std::sqrt(squared_error / static_cast<double>(correct)); }
};

MatchQuality match_quality(const SquareWorld& world, const Motion& motion, const OrbFeatures& first,
                           const OrbFeatures& second) {
  MatchQuality quality;
  for (const Corner& corner : first.corners) {
    double x = 0, y = 0;
    world.move(motion, corner.x, corner.y, x, y);
    quality.in_view += x > 30 && y > 30 && x < 610 && y < 450;
  }
  for (size_t i = 0; i < first.corners.size(); ++i) {
    const auto nearer = [&](const Descriptor& one, const Descriptor& other) {
      return hamming_distance(first.descriptors[i], one) < hamming_distance(first.descriptors[i], other);
    };
    const auto nearest = std::min_element(second.descriptors.begin(), second.descriptors.end(), nearer);
    const Corner& a = first.corners[i];
    const Corner& b = second.corners[static_cast<size_t>(nearest - second.descriptors.begin())];
    double x = 0, y = 0;
    world.move(motion, a.x, a.y, x, y);
    if (x <= 30 || y <= 30 || x >= 610 || y >= 450) continue;
    const double error = std::hypot(b.x - x, b.y - y) / std::pow(1.2, a.octave);
    if (error > 2.5) continue;
    ++quality.correct;
    quality.squared_error += error * error;
  }
  return quality;
}

void expect_equal(const OrbFeatures& a, const OrbFeatures& b) {
  ASSERT_EQ(a.corners.size(), b.corners.size());
  EXPECT_EQ(a.descriptors, b.descriptors);
  for (size_t i = 0; i < a.corners.size(); ++i) {
    EXPECT_EQ(a.corners[i].x, b.corners[i].x);
    EXPECT_EQ(a.corners[i].y, b.corners[i].y);
    EXPECT_EQ(a.corners[i].angle, b.corners[i].angle);
    EXPECT_EQ(a.corners[i].response, b.corners[i].response);
    EXPECT_EQ(a.corners[i].octave, b.corners[i].octave);
  }
}

// Whoever sees its own robot wants no corner of it, nor of its outline.
TEST(OrbExtractor, NoCornersCircleReachesIntoWhatIsLeftOut) {
  const GreyImage image = test_world(3).render({});
  Image<uint8_t> mask(640, 480);
  for (int y = 200; y < 300; ++y)
    for (int x = 100; x < 420; ++x) mask(x, y) = 1;
  const auto inside = [](const Corner& c, double margin) {
    return c.x > 100 - margin && c.x < 419 + margin && c.y > 200 - margin && c.y < 299 + margin;
  };
  const auto count = [&](const OrbFeatures& features, double margin) {
    return std::count_if(features.corners.begin(), features.corners.end(),
                         [&](const Corner& c) { return inside(c, margin * std::pow(1.2, c.octave)); });
  };
  OrbExtractor extractor;
  const OrbFeatures all = extractor.extract(image);
  EXPECT_GT(count(all, 0), 50);
  extractor.leave_out(mask);
  const OrbFeatures left = extractor.extract(image);
  EXPECT_EQ(count(left, 2.4), 0);  // a circle of 3 px, and half a pixel of refinement
  EXPECT_EQ(left.corners.size(), all.corners.size()) << "the others make up for them";
  extractor.leave_out({});
  EXPECT_EQ(extractor.extract(image).descriptors, all.descriptors);
}

TEST(Orientation, PointsAlongTheBrighterSide) {
  const double directions[] = {0.3, 1.7, 3.0, 4.4, 6.0};
  for (const double direction : directions) {
    GreyImage image(64, 64);
    for (int y = 0; y < 64; ++y)
      for (int x = 0; x < 64; ++x)
        image(x, y) = static_cast<uint8_t>(128 + 2 * ((x - 32) * std::cos(direction) + (y - 32) * std::sin(direction)));
    EXPECT_NEAR(orientation_angle(centroid_moments(image.row(32) + 32, 64)), direction, 0.02);
  }
  const GreyImage flat(64, 64, 77);
  EXPECT_EQ(orientation_angle(centroid_moments(flat.row(32) + 32, 64)), 0.0F);
}

TEST(Orientation, MomentsOfOneBrightPixelAreItsPosition) {
  GreyImage image(64, 64);
  image(32 + 9, 32 - 12) = 200;  // 9^2 + 12^2 = 15^2: just inside
  EXPECT_EQ(centroid_moments(image.row(32) + 32, 64), (CentroidMoments{9 * 200, -12 * 200}));
  image(32 + 10, 32 + 12) = 200;  // just outside
  EXPECT_EQ(centroid_moments(image.row(32) + 32, 64), (CentroidMoments{9 * 200, -12 * 200}));
}

TEST(Orientation, VectorKernelEqualsScalar) {
  const GreyImage image = noise_image(80, 60, 9);
  for (int y = 16; y < 44; ++y)
    for (int x = 16; x < 63; ++x)
      EXPECT_EQ(centroid_moments(image.row(y) + x, 80), centroid_moments(image.row(y) + x, 80, Simd::scalar));
}

TEST(GaussianBlur, VectorKernelEqualsScalar) {
  for (const int width : {5, 6, 7, 37, 38, 39, 64, 161}) {
    const GreyImage image = noise_image(width, 23, 3);
    GreyImage fast, scalar;
    GaussianBlur().apply(image, fast);
    GaussianBlur(Simd::scalar).apply(image, scalar);
    EXPECT_EQ(fast, scalar);
  }
}

#ifdef DKB_TEST_OPENCV
TEST(GaussianBlur, IsWithinRoundingOfOpenCvs) {
  const GreyImage image = noise_image(161, 90, 3);
  GreyImage blurred;
  GaussianBlur().apply(image, blurred);
  const cv::Mat wrapped(image.height(), image.width(), CV_8U, const_cast<uint8_t*>(image.data()));
  cv::Mat expected;
  cv::GaussianBlur(wrapped, expected, {7, 7}, 2.0, 2.0);
  for (int y = 3; y < image.height() - 3; ++y)
    for (int x = 3; x < image.width() - 3; ++x) EXPECT_NEAR(blurred(x, y), expected.at<uint8_t>(y, x), 2);
}
#endif

TEST(SteeredBrief, BitsAreFairAndTestsOfDifferentPlacesDiffer) {
  OrbExtractor extractor;
  const OrbFeatures features = extractor.extract(test_world(3).render({}, 2.0));
  ASSERT_GT(features.descriptors.size(), 900u);
  size_t set = 0, distance = 0;
  for (size_t i = 0; i < features.descriptors.size(); ++i) {
    set += static_cast<size_t>(hamming_distance(features.descriptors[i], Descriptor{}));
    distance += static_cast<size_t>(hamming_distance(features.descriptors[i], features.descriptors[(i + 499) % 900]));
  }
  const double n = static_cast<double>(features.descriptors.size());
  EXPECT_NEAR(static_cast<double>(set) / n, 128, 20);
  EXPECT_GT(static_cast<double>(distance) / n, 90);  // squares look much alike
}

TEST(SteeredBrief, VectorKernelEqualsScalar) {
  const GreyImage image = noise_image(70, 60, 9);
  const SteeredBrief fast, scalar(Simd::scalar);
  for (float angle = 0; angle < 6.28F; angle += 0.01F)
    EXPECT_EQ(fast.describe(image.row(30) + 30, 70, angle), scalar.describe(image.row(30) + 30, 70, angle));
}

TEST(CornerSpread, KeepsExactlyTheCountAndTheStrongestOfEachCell) {
  // Two cells side by side; the left one is crowded with strong corners, the right one has two weak ones.
  std::vector<PixelCorner> corners;
  for (int i = 0; i < 30; ++i)
    corners.push_back({static_cast<uint16_t>(3 * i), 10, static_cast<uint8_t>(60 + (7 * i) % 30)});
  corners.push_back({150, 20, 8});
  corners.push_back({160, 20, 9});
  CornerSpread spread;
  spread.keep({0, 0, 200, 100}, 2 * CornerSpread::kCornersPerCell, corners);
  ASSERT_EQ(corners.size(), 16u);
  for (size_t i = 0; i < 14; ++i) EXPECT_EQ(corners[i].score, 89 - i);  // scores 60 ... 89 occur once each
  EXPECT_EQ(corners[14], (PixelCorner{160, 20, 9}));
  EXPECT_EQ(corners[15], (PixelCorner{150, 20, 8}));
}

TEST(CornerSpread, WeakCornersSurviveOnlyWhereThereIsNothingStronger) {
  std::vector<PixelCorner> corners = {{10, 10, 25}, {12, 20, 8}, {50, 10, 9}, {40, 20, 7}};
  CornerSpread spread;
  spread.drop_weak({0, 0, 64, 32}, 20, 32, corners);
  EXPECT_EQ(corners, (std::vector<PixelCorner>{{10, 10, 25}, {50, 10, 9}, {40, 20, 7}}));
}

TEST(OrbExtractor, FindsTheCountAskedForInOrderOfLevels) {
  const GreyImage image = test_world(1).render({}, 2.0);
  for (const int count : {1, 10, 500, 1000, 2000}) {
    OrbExtractor extractor({.count = count});
    const OrbFeatures features = extractor.extract(image);
    EXPECT_EQ(features.corners.size(), static_cast<size_t>(count));
    EXPECT_EQ(features.descriptors.size(), features.corners.size());
    for (size_t i = 1; i < features.corners.size(); ++i)
      EXPECT_LE(features.corners[i - 1].octave, features.corners[i].octave);
  }
}

TEST(OrbExtractor, CoversTheImageEvenly) {
  // The left half has strong texture, the right half faint texture: still both are covered.
  GreyImage image = test_world(2).render({}, 1.0);
  for (int y = 0; y < 480; ++y)
    for (int x = 320; x < 640; ++x) image(x, y) = static_cast<uint8_t>(110 + (image(x, y) - 110) / 6);
  OrbExtractor extractor;
  const OrbFeatures features = extractor.extract(image);
  const auto left =
      std::count_if(features.corners.begin(), features.corners.end(), [](const Corner& c) { return c.x < 320; });
  EXPECT_GT(left, 350);
  EXPECT_LT(left, 750);
}

TEST(OrbExtractor, VectorKernelsEqualScalarBitForBit) {
  for (const uint64_t seed : {1, 2}) {
    const GreyImage image = test_world(seed).render({}, 2.0, seed);
    OrbExtractor fast({}, best_simd()), scalar({}, Simd::scalar);
    expect_equal(fast.extract(image), scalar.extract(image));
  }
}

TEST(OrbExtractor, ReusedObjectsGiveTheSameAsFreshOnes) {
  const GreyImage first = test_world(1).render({}, 2.0), second = test_world(2).render({}, 2.0);
  OrbExtractor reused, fresh;
  reused.extract(first);
  reused.extract(noise_image(200, 100, 1));
  expect_equal(reused.extract(second), fresh.extract(second));
}

TEST(OrbExtractor, ImagesWithoutCornersOrRoomGiveNone) {
  OrbExtractor extractor;
  EXPECT_TRUE(extractor.extract(GreyImage(640, 480, 90)).corners.empty());
  EXPECT_TRUE(extractor.extract(noise_image(38, 38, 1)).corners.empty());
  EXPECT_TRUE(extractor.extract(noise_image(1, 1, 1)).corners.empty());
  EXPECT_FALSE(extractor.extract(noise_image(60, 60, 1)).corners.empty());
  EXPECT_THROW(extractor.extract(GreyImage()), InputError);
}

TEST(OrbExtractor, SubpixelPositionsAreAtLeastAThirdMoreAccurateThanPixels) {
  const SquareWorld world = test_world(4);
  OrbExtractor extractor;
  const auto in_whole_pixels = [&](OrbFeatures features) {
    const ImagePyramid& pyramid = extractor.pyramid();
    for (Corner& c : features.corners) {
      c.x = static_cast<float>(pyramid.full_x(c.octave, std::round(pyramid.level_x(c.octave, c.x))));
      c.y = static_cast<float>(pyramid.full_y(c.octave, std::round(pyramid.level_y(c.octave, c.y))));
    }
    return features;
  };
  const GreyImage first = world.render({}, 2.0, 1);
  for (const Motion& motion : {Motion{1, 0, 3.37, -2.61}, Motion::turned(10 * kDegree, 1.0, 0.4, 0.3)}) {
    const GreyImage second = world.render(motion, 2.0, 2);
    const OrbFeatures from = extractor.extract(first), to = extractor.extract(second);
    const double error = match_quality(world, motion, from, to).rms();
    const double rounded_error = match_quality(world, motion, in_whole_pixels(from), in_whole_pixels(to)).rms();
    EXPECT_LT(error, 0.67 * rounded_error);
  }
}

TEST(OrbExtractor, PositionsHaveNoBiasOverLevels) {
  // A symmetric blob lies at the same full-resolution place on whatever level it is found.
  GreyImage image(320, 240, 60);
  for (int y = 0; y < 240; ++y)
    for (int x = 0; x < 320; ++x)
      image(x, y) = static_cast<uint8_t>(60 + 150 * std::exp(-(std::pow(x - 150.3, 2) + std::pow(y - 110.6, 2)) / 18));
  OrbExtractor extractor({.count = 50});
  const OrbFeatures features = extractor.extract(image);
  ASSERT_FALSE(features.corners.empty());
  for (const Corner& corner : features.corners) {
    EXPECT_NEAR(corner.x, 150.3, 0.25 * std::pow(1.2, corner.octave));
    EXPECT_NEAR(corner.y, 110.6, 0.25 * std::pow(1.2, corner.octave));
  }
}

TEST(OrbExtractor, MatchesAcrossShiftTurnAndScale) {
  const SquareWorld world = test_world(5);
  OrbExtractor extractor;
  const OrbFeatures first = extractor.extract(world.render({}, 2.0, 1));
  const auto share = [&](const Motion& motion) {
    return match_quality(world, motion, first, extractor.extract(world.render(motion, 2.0, 2))).share();
  };
  EXPECT_GT(share({1, 0, 5.5, -3.2}), 0.75);
  EXPECT_GT(share(Motion::turned(30 * kDegree)), 0.65);
  EXPECT_GT(share(Motion::turned(170 * kDegree)), 0.65);
  EXPECT_GT(share(Motion::turned(5 * kDegree, 1.25)), 0.5);
}

#ifdef DKB_TEST_OPENCV
TEST(OrbExtractor, DescriptorsMatchAtLeastAsWellAsOpenCvsOnTheSameCorners) {
  const SquareWorld world = test_world(6);
  OrbExtractor extractor;
  const auto orb = cv::ORB::create(1000);
  const auto opencv_descriptors = [&](const GreyImage& image, OrbFeatures features) {
    std::vector<cv::KeyPoint> keypoints;
    OrbFeatures kept;
    for (const Corner& c : features.corners) {
      if (c.x < 33 || c.y < 33 || c.x > 606 || c.y > 446) continue;
      kept.corners.push_back(c);
      const int level = c.octave;
      const float s = std::pow(1.2F, static_cast<float>(level));
      const float x = static_cast<float>(std::round(extractor.pyramid().level_x(level, c.x)));
      const float y = static_cast<float>(std::round(extractor.pyramid().level_y(level, c.y)));
      keypoints.emplace_back(x * s, y * s, 31 * s, static_cast<float>(c.angle / kDegree), c.response, level);
    }
    cv::Mat descriptors;
    orb->compute(cv::Mat(480, 640, CV_8U, const_cast<uint8_t*>(image.data())), keypoints, descriptors);
    EXPECT_EQ(keypoints.size(), kept.corners.size());
    kept.descriptors.resize(kept.corners.size());
    for (size_t i = 0; i < kept.corners.size(); ++i)
      std::copy_n(descriptors.ptr(static_cast<int>(i)), 32, reinterpret_cast<uint8_t*>(kept.descriptors[i].data()));
    return kept;
  };
  const GreyImage first = world.render({}, 2.0, 1);
  for (const Motion& motion :
       {Motion{1, 0, 3.4, -2.6}, Motion::turned(25 * kDegree), Motion::turned(4 * kDegree, 1.15)}) {
    const GreyImage second = world.render(motion, 2.0, 2);
    const OrbFeatures a = extractor.extract(first), b = extractor.extract(second);
    const double ours = match_quality(world, motion, a, b).share();
    const double theirs =
        match_quality(world, motion, opencv_descriptors(first, a), opencv_descriptors(second, b)).share();
    EXPECT_GT(ours, theirs - 0.01);
  }
}
#endif

TEST(OrbExtractor, APoorPlaceGetsHalfOfTheFeaturesAtMost) {
  const SquareWorld world = test_world(5);
  const GreyImage image = world.render({});
  Image<uint8_t> poor(160, 120);  // cells of 4 px: all but a strip of a fifth
  for (int y = 0; y < 120; ++y)
    for (int x = 32; x < 160; ++x) poor(x, y) = 255;
  const auto rich = [](const OrbFeatures& features) {
    return std::count_if(features.corners.begin(), features.corners.end(), [](const Corner& c) { return c.x < 128; });
  };
  OrbExtractor extractor({.count = 400});
  const OrbFeatures even = extractor.extract(image), other = extractor.extract(image, poor, 4);
  EXPECT_LT(rich(even), 120);
  EXPECT_GT(rich(other), 180);
  EXPECT_EQ(other.corners.size(), even.corners.size());
  expect_equal(extractor.extract(image, Image<uint8_t>(160, 120), 4), even);
}

}  // namespace
}  // namespace dkb
