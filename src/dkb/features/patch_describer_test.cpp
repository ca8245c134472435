// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/patch_describer.h"

#include <gtest/gtest.h>

#include <limits>

#include "dkb/features/orb_extractor.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

// Blocks of random greys: corners without end.
GreyImage blocks(uint64_t seed) {
  Random random(seed);
  GreyImage cells(40, 30), image(320, 240);
  for (size_t i = 0; i < cells.size(); ++i) cells.data()[i] = static_cast<uint8_t>(random.below(256));
  for (int y = 0; y < image.height(); ++y)
    for (int x = 0; x < image.width(); ++x) image(x, y) = cells(x / 8, y / 8);
  return image;
}

TEST(PatchDescriber, SeesWhatTheExtractorSawAndNotWhatIsElsewhere) {
  const GreyImage image = blocks(1);
  const OrbFeatures features = OrbExtractor().extract(image);
  ASSERT_GT(features.corners.size(), 200U);
  PatchDescriber same({}), other({});
  same.set_image(image);
  other.set_image(blocks(2));
  int compared = 0, unlike = 0;
  for (size_t i = 0; i < features.corners.size(); ++i) {
    const Corner& c = features.corners[i];
    const auto here = same.distance(c.x, c.y, c.octave, features.descriptors[i]);
    if (!here) continue;
    ++compared;
    EXPECT_EQ(*here, 0) << "corner " << i;
    unlike += *other.distance(c.x, c.y, c.octave, features.descriptors[i]) > 80;
  }
  EXPECT_GT(compared, 150);
  EXPECT_GT(unlike, 0.9 * compared);
}

TEST(PatchDescriber, TellsNothingBeyondTheImage) {
  PatchDescriber describer({});
  EXPECT_FALSE(describer.distance(100, 100, 0, {})) << "no image yet";
  describer.set_image(blocks(1));
  EXPECT_TRUE(describer.distance(100, 100, 0, {}));
  EXPECT_FALSE(describer.distance(5, 100, 0, {}));
  EXPECT_FALSE(describer.distance(100, 238, 0, {}));
  EXPECT_FALSE(describer.distance(-1e9f, 100, 0, {}));
  EXPECT_FALSE(describer.distance(std::numeric_limits<float>::quiet_NaN(), 100, 0, {}));
  EXPECT_FALSE(describer.distance(100, 100, 99, {}));
}

}  // namespace
}  // namespace dkb
