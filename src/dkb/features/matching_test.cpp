// SPDX-License-Identifier: Apache-2.0
#include "dkb/features/matching.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "dkb/features/rgbd_features.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

std::vector<Descriptor> random_descriptors(size_t count, uint64_t seed) {
  Random random(seed);
  std::vector<Descriptor> descriptors(count);
  for (Descriptor& d : descriptors)
    for (uint64_t& word : d) word = random.next();
  return descriptors;
}

// The same with `bits` random bits flipped (some perhaps twice).
Descriptor disturbed(Descriptor d, int bits, Random& random) {
  for (int i = 0; i < bits; ++i) d[random.below(4)] ^= uint64_t{1} << random.below(64);
  return d;
}

TEST(Matching, HammingDistanceCountsDifferingBits) {
  const Descriptor zero{}, full{~uint64_t{0}, ~uint64_t{0}, ~uint64_t{0}, ~uint64_t{0}};
  EXPECT_EQ(hamming_distance(zero, zero), 0);
  EXPECT_EQ(hamming_distance(zero, full), 256);
  EXPECT_EQ(hamming_distance(zero, Descriptor{1, 3, 7, uint64_t{1} << 63}), 7);  // 1 + 2 + 3 + 1
  const std::vector<Descriptor> d = random_descriptors(200, 1);
  for (size_t i = 1; i < d.size(); ++i) {
    int expected = 0;
    for (size_t w = 0; w < 4; ++w) expected += std::popcount(d[i][w] ^ d[i - 1][w]);
    EXPECT_EQ(hamming_distance(d[i], d[i - 1]), expected);
  }
}

TEST(Matching, TiesGoToTheFirstAndNothingMatchesNothing) {
  const std::vector<Descriptor> set = random_descriptors(3, 2);
  const std::vector<Descriptor> b = {set[1], set[1], set[2]};
  EXPECT_EQ(match_brute_force(set, b), (std::vector<DescriptorMatch>{{2, 2, 0}}))
      << "two as near as each other are told apart by nothing";
  const std::vector<Descriptor> twice = {set[1], set[1]}, once = {set[1]};
  EXPECT_EQ(match_brute_force(twice, once), (std::vector<DescriptorMatch>{{0, 0, 0}}));
  EXPECT_TRUE(match_brute_force({}, set).empty());
  EXPECT_TRUE(match_brute_force(set, {}).empty());
}

TEST(Matching, BruteForceFindsDisturbedCopiesAndNothingElse) {
  const std::vector<Descriptor> a = random_descriptors(200, 4);
  std::vector<Descriptor> b = random_descriptors(150, 5);
  Random random(6);
  for (size_t i = 0; i < 100; ++i) b[149 - i] = disturbed(a[2 * i], 30, random);
  const std::vector<DescriptorMatch> matches = match_brute_force(a, b);
  ASSERT_EQ(matches.size(), 100u);
  for (size_t i = 0; i < 100; ++i) {
    EXPECT_EQ(matches[i].a, static_cast<int>(2 * i));
    EXPECT_EQ(matches[i].b, static_cast<int>(149 - i));
    EXPECT_LE(matches[i].distance, 30);
  }
  EXPECT_EQ(match_brute_force(a, b, Simd::scalar), matches);
}

TEST(Matching, RatioAndMutualTestsRejectRepeatedStructure) {
  const std::vector<Descriptor> a = random_descriptors(1, 7);
  Random random(8);
  const std::vector<Descriptor> twice = {disturbed(a[0], 5, random), disturbed(a[0], 6, random)};
  EXPECT_TRUE(match_brute_force(a, twice).empty());
  EXPECT_EQ(match_brute_force(a, std::span(twice).first(1)).size(), 1u);
  // Two of a look like the one b: only the nearer one may have it.
  const std::vector<Descriptor> pair = {disturbed(a[0], 20, random), a[0]};
  const std::vector<DescriptorMatch> mutual = match_brute_force(pair, a);
  ASSERT_EQ(mutual.size(), 1u);
  EXPECT_EQ(mutual[0].a, 1);
  EXPECT_EQ(match_brute_force(std::span(pair).first(1), a).size(), 1u);
}

TEST(KeypointGrid, FindsExactlyThePointsWithinTheSquareInAFixedOrder) {
  Random random(10);
  std::vector<Keypoint> points(500);
  for (Keypoint& p : points) {
    p.pixel.x() = static_cast<float>(random.uniform(-30, 670));  // some outside the image
    p.pixel.y() = static_cast<float>(random.uniform(-30, 510));
    p.octave = static_cast<uint8_t>(random.below(8));
  }
  const KeypointGrid grid(points, 640, 480);
  for (int trial = 0; trial < 100; ++trial) {
    const float cx = static_cast<float>(random.uniform(-40, 680)), cy = static_cast<float>(random.uniform(-40, 520));
    const float radius = static_cast<float>(random.uniform(0, 60));
    std::vector<int> found, again, expected;
    grid.for_each_near({cx, cy, radius}, [&](int i) { found.push_back(i); });
    grid.for_each_near({cx, cy, radius}, [&](int i) { again.push_back(i); });
    EXPECT_EQ(found, again);
    for (size_t i = 0; i < points.size(); ++i)
      if (std::abs(points[i].pixel.x() - cx) <= radius && std::abs(points[i].pixel.y() - cy) <= radius)
        expected.push_back(static_cast<int>(i));
    std::sort(found.begin(), found.end());
    EXPECT_EQ(found, expected);
    const int least = static_cast<int>(random.below(9)) - 1, most = least + 2;
    found.clear();
    grid.for_each_near({cx, cy, radius, least, most}, [&](int i) { found.push_back(i); });
    std::sort(found.begin(), found.end());
    std::erase_if(expected, [&](int i) {
      const int octave = points[static_cast<size_t>(i)].octave;
      return octave < least || octave > most;
    });
    EXPECT_EQ(found, expected);
  }
}

TEST(KeypointGrid, AnEmptyGridHasNoNeighbours) {
  int visits = 0;
  KeypointGrid().for_each_near({1, 1, 100}, [&](int) { ++visits; });
  KeypointGrid(std::vector<Keypoint>(), 640, 480).for_each_near({1, 1, 100}, [&](int) { ++visits; });
  EXPECT_EQ(visits, 0);
}

}  // namespace
}  // namespace dkb
