// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/image_appearance.h"

#include <gtest/gtest.h>

#include "dkb/features/feature_test_util.h"
#include "dkb/features/orb_extractor.h"
#include "dkb/image/rgbd_image.h"

namespace dkb {
namespace {

// Blocks of random greys on a wall at 2 m.
RgbdImage wall(uint64_t seed) {
  RgbdImage image;
  image.grey = blocks_image(seed);
  image.depth = DepthImage(320, 240, 2.0f);
  return image;
}

class ImageAppearanceTest : public ::testing::Test {
 protected:
  ImageAppearanceTest() {
    camera.width = 320, camera.height = 240;
    features = OrbExtractor().extract(image.grey);
    for (size_t i = 0; i < features.corners.size() && chosen == nullptr; ++i) {
      const Corner& c = features.corners[i];
      if (c.octave <= 1 && c.x > 100 && c.x < 220 && c.y > 80 && c.y < 160)
        chosen = &c, descriptor = features.descriptors[i];
    }
  }
  Look look_in(const RgbdImage& seen, double depth = 2) const {
    OrbExtractor extractor;
    extractor.extract(seen.grey);
    ImageAppearance appearance(seen.depth, camera, {}, extractor.pyramid(), extractor.brief());
    return appearance.look({chosen->x, chosen->y}, depth, chosen->octave, descriptor);
  }

  Camera camera;
  RgbdImage image = wall(1);
  OrbFeatures features;
  const Corner* chosen = nullptr;
  Descriptor descriptor{};
};

TEST_F(ImageAppearanceTest, APlaceThatLooksAsItDidIsTheSame) {
  ASSERT_NE(chosen, nullptr);
  EXPECT_EQ(look_in(image), Look::same);
}

TEST_F(ImageAppearanceTest, AnotherPictureAtItsPlaceIsAnother) {
  ASSERT_NE(chosen, nullptr);
  int different = 0, told = 0;
  for (uint64_t seed = 2; seed < 12; ++seed) {
    const Look look = look_in(wall(seed));
    told += look != Look::unknown;
    different += look == Look::other;
  }
  EXPECT_GE(told, 5);
  EXPECT_GT(different, 0.8 * told) << "pictures of blocks on one grid may look alike by chance";
}

TEST_F(ImageAppearanceTest, WhatIsHiddenOrGoneIsNotTold) {
  ASSERT_NE(chosen, nullptr);
  EXPECT_EQ(look_in(image, 2.2), Look::unknown) << "something stands 20 cm before it";
  EXPECT_EQ(look_in(image, 1.8), Look::unknown) << "what is seen lies 20 cm behind it";
  EXPECT_EQ(look_in(image, 2.05), Look::same) << "within the tolerance of a surface, 5.6 cm";
  RgbdImage blind = image;
  blind.depth = DepthImage(320, 240);
  EXPECT_EQ(look_in(blind), Look::unknown) << "no depth";
}

TEST_F(ImageAppearanceTest, PlacesOutsideTheImageAreNotTold) {
  OrbExtractor extractor;
  extractor.extract(image.grey);
  ImageAppearance appearance(image.depth, camera, {}, extractor.pyramid(), extractor.brief());
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(-5, 100), {400, 100}, {100, -1}, {100, 300}, {1e12, -1e12}})
    EXPECT_EQ(appearance.look(pixel, 2, 0, {}), Look::unknown);
}

}  // namespace
}  // namespace dkb
