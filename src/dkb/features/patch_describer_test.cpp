// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/patch_describer.h"

#include <gtest/gtest.h>

#include <limits>

#include "dkb/features/feature_test_util.h"
#include "dkb/features/orb_extractor.h"

namespace dkb {
namespace {

TEST(PatchDescriber, SeesWhatTheExtractorSawAndNotWhatIsElsewhere) {
  OrbExtractor extractor, elsewhere;
  const OrbFeatures features = extractor.extract(blocks_image(1));
  ASSERT_GT(features.corners.size(), 200U);
  elsewhere.extract(blocks_image(2));
  PatchDescriber same(extractor.pyramid(), extractor.brief()), other(elsewhere.pyramid(), elsewhere.brief());
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
  ImagePyramid pyramid;
  const SteeredBrief brief;
  EXPECT_FALSE(PatchDescriber(pyramid, brief).distance(100, 100, 0, {})) << "no image yet";
  pyramid.build(blocks_image(1));
  PatchDescriber describer(pyramid, brief);
  EXPECT_TRUE(describer.distance(100, 100, 0, {}));
  EXPECT_FALSE(describer.distance(5, 100, 0, {}));
  EXPECT_FALSE(describer.distance(100, 238, 0, {}));
  EXPECT_FALSE(describer.distance(-1e9f, 100, 0, {}));
  EXPECT_FALSE(describer.distance(std::numeric_limits<float>::quiet_NaN(), 100, 0, {}));
  EXPECT_FALSE(describer.distance(100, 100, 99, {}));
}

}  // namespace
}  // namespace dkb
