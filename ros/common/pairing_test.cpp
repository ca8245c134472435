// SPDX-License-Identifier: Apache-2.0
#include "pairing.h"

#include <gtest/gtest.h>

namespace dkb_ros {
namespace {

constexpr int64_t kMs = 1'000'000;

ImageMessage image(int64_t ms) {
  ImageMessage m;
  m.stamp_ns = ms * kMs;
  return m;
}

TEST(Pairing, EqualStampsPairAtOnce) {
  Pairing pairing(20 * kMs, 10);
  for (int64_t t = 0; t < 300; t += 33) {
    EXPECT_TRUE(pairing.add_depth(image(t)).empty());
    const auto pairs = pairing.add_colour(image(t));
    ASSERT_EQ(pairs.size(), 1u);
    EXPECT_EQ(pairs[0].colour.stamp_ns, pairs[0].depth.stamp_ns);
  }
  EXPECT_EQ(pairing.unpaired(), 0);
}

TEST(Pairing, TheNearestPairAndNotTheFirst) {
  // Depth 12 ms after colour: also 21 ms before the next colour image.
  Pairing pairing(25 * kMs, 10);
  std::vector<ImagePair> all;
  const auto take = [&](std::vector<ImagePair> pairs) {
    for (ImagePair& p : pairs) all.push_back(std::move(p));
  };
  for (int64_t t = 0; t < 330; t += 33) {
    take(pairing.add_colour(image(t)));
    take(pairing.add_depth(image(t + 12)));
  }
  ASSERT_GE(all.size(), 9u);
  for (const ImagePair& p : all) EXPECT_EQ(p.depth.stamp_ns - p.colour.stamp_ns, 12 * kMs);
  EXPECT_EQ(pairing.unpaired(), 0);
}

TEST(Pairing, OnceTheRateIsKnownAPairDoesNotWaitForTheNextImage) {
  Pairing pairing(20 * kMs, 10);
  for (int64_t t = 0; t < 330; t += 33) {
    pairing.add_depth(image(t - 5));
    const size_t pairs = pairing.add_colour(image(t)).size();
    if (t > 66) {
      EXPECT_EQ(pairs, 1u) << t;
    }
  }
}

TEST(Pairing, ImagesWithoutAPartnerAreCountedAndHarmNothing) {
  Pairing pairing(20 * kMs, 10);
  size_t pairs = 0;
  for (int64_t i = 0; i < 30; ++i) {
    pairs += pairing.add_colour(image(33 * i)).size();
    if (i % 3 != 0) pairs += pairing.add_depth(image(33 * i)).size();
  }
  EXPECT_EQ(pairs, 20u);
  EXPECT_EQ(pairing.unpaired(), 10);
}

TEST(Pairing, AStreamAloneNeverFillsTheMemory) {
  Pairing pairing(20 * kMs, 10);
  for (int64_t i = 0; i < 100; ++i) EXPECT_TRUE(pairing.add_colour(image(33 * i)).empty());
  EXPECT_EQ(pairing.unpaired(), 90);
}

TEST(Pairing, LateAndDoubleImagesAreCounted) {
  Pairing pairing(20 * kMs, 10);
  pairing.add_colour(image(100));
  pairing.add_colour(image(133));
  pairing.add_colour(image(133));
  pairing.add_colour(image(66));
  EXPECT_EQ(pairing.late(), 2);
}

TEST(Pairing, AClockThatWentBackBeginsAnewAndSaysSo) {
  Pairing pairing(20 * kMs, 10);
  for (int64_t t = 10000; t < 10300; t += 33) {
    pairing.add_colour(image(t));
    for (const ImagePair& p : pairing.add_depth(image(t))) EXPECT_FALSE(p.clock_jumped);
  }
  std::vector<bool> jumped;
  for (int64_t t = 0; t < 330; t += 33) {
    pairing.add_colour(image(t));
    for (const ImagePair& p : pairing.add_depth(image(t))) jumped.push_back(p.clock_jumped);
  }
  ASSERT_GE(jumped.size(), 5u);
  EXPECT_TRUE(jumped[0]);
  EXPECT_EQ(std::count(jumped.begin(), jumped.end(), true), 1);
}

// Both streams, or one, with a stamp far ahead once: how many pairs come of 30 stamps, and none says that a clock
// jumped.
size_t pairs_with_one_far_ahead(bool colour_ahead, bool depth_ahead, int64_t times) {
  Pairing pairing(20 * kMs, 10);
  size_t count = 0;
  for (int64_t i = 0; i < 30; ++i) {
    const int64_t broken = i >= 3 && i < 3 + times ? 5000 : 0;
    std::vector<ImagePair> pairs = pairing.add_colour(image(33 * i + (colour_ahead ? broken : 0)));
    for (ImagePair& p : pairing.add_depth(image(33 * i + (depth_ahead ? broken : 0)))) pairs.push_back(std::move(p));
    for (const ImagePair& p : pairs) {
      EXPECT_FALSE(p.clock_jumped) << i;
      EXPECT_LT(p.colour.stamp_ns, 1000 * kMs);
    }
    count += pairs.size();
  }
  return count;
}

TEST(Pairing, OneStampFarAheadCostsNoMoreThanItsImages) {
  EXPECT_EQ(pairs_with_one_far_ahead(true, true, 1), 29u);
  EXPECT_EQ(pairs_with_one_far_ahead(true, false, 1), 29u);
  EXPECT_EQ(pairs_with_one_far_ahead(false, true, 1), 29u);
  // Two that confirm each other, of one stream, until three that follow say that they were wrong.
  EXPECT_GE(pairs_with_one_far_ahead(true, false, 2), 24u);
}

TEST(Pairing, APauseLosesNoImage) {
  Pairing pairing(20 * kMs, 10);
  size_t pairs = 0;
  for (int64_t i = 0; i < 30; ++i) {
    const int64_t t = 33 * i + (i < 10 ? 0 : 60'000);
    pairs += pairing.add_depth(image(t)).size() + pairing.add_colour(image(t)).size();
  }
  EXPECT_EQ(pairs, 30u);
  EXPECT_EQ(pairing.unpaired() + pairing.late(), 0);
}

TEST(Pairing, SingleImagesAfterABurstComeOneImageLateAtMost) {
  Pairing pairing(20 * kMs, 10);
  size_t pairs = 0;
  for (int64_t i = 0; i < 20; ++i) {
    const int64_t t = i < 12 ? 33 * i : 5000 * i;
    pairs += pairing.add_depth(image(t)).size() + pairing.add_colour(image(t)).size();
    if (i >= 13) {
      EXPECT_GE(pairs, static_cast<size_t>(i)) << i;
    }
  }
}

TEST(Pairing, OneStreamAloneWithPausesKeepsToTheQueue) {
  Pairing pairing(20 * kMs, 4);
  for (int64_t i = 0; i < 40; ++i) pairing.add_colour(image(33 * i + 5000 * (i / 4)));
  EXPECT_GE(pairing.unpaired(), 40 - 4 - 1);
}

TEST(Pairing, ImagesEveryTwoSecondsPair) {
  Pairing pairing(20 * kMs, 10);
  size_t pairs = 0;
  for (int64_t i = 0; i < 30; ++i)
    pairs += pairing.add_depth(image(2000 * i)).size() + pairing.add_colour(image(2000 * i)).size();
  EXPECT_EQ(pairs, 30u);
  EXPECT_EQ(pairing.unpaired() + pairing.late(), 0);
}

}  // namespace
}  // namespace dkb_ros
