// SPDX-License-Identifier: Apache-2.0
#include "dkb/recordings/stamp_pairing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "dkb/util/random.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

using Stamps = std::vector<int64_t>;
using StampPairs = std::vector<std::pair<int64_t, int64_t>>;

constexpr int64_t kMs = 1'000'000;

std::vector<double> seconds(const Stamps& stamps) {
  std::vector<double> out;
  for (const int64_t ns : stamps) out.push_back(seconds_from_ns(ns));
  return out;
}

StampPairs by_lists(const Stamps& a, const Stamps& b) {
  StampPairs pairs;
  for (const auto& [i, j] : associate(seconds(a), seconds(b))) pairs.emplace_back(a[i], b[j]);
  return pairs;
}

// Depth images arrive up to `lag` later than their stamps say.
StampPairs by_stream(const Stamps& a, const Stamps& b, int64_t lag, size_t* most_waiting = nullptr) {
  StampPairing pairing;
  StampPairs pairs;
  size_t waiting = 0;
  const auto take = [&] {
    while (const auto pair = pairing.take()) {
      EXPECT_EQ(pair->colour.bytes, std::to_string(pair->colour.stamp_ns));
      EXPECT_EQ(pair->depth.bytes, std::to_string(pair->depth.stamp_ns));
      pairs.emplace_back(pair->colour.stamp_ns, pair->depth.stamp_ns);
      waiting -= 2;
    }
  };
  for (size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    const bool first = j >= b.size() || (i < a.size() && a[i] <= b[j] + lag);
    const int64_t stamp = first ? a[i++] : b[j++];
    EXPECT_TRUE(pairing.add(first ? StampPairing::colour : StampPairing::depth, {stamp, std::to_string(stamp)}));
    ++waiting;
    take();
    if (most_waiting != nullptr)
      *most_waiting = std::max(*most_waiting, waiting - static_cast<size_t>(pairing.unpaired()));
  }
  pairing.close();
  take();
  EXPECT_EQ(static_cast<size_t>(pairing.unpaired()), a.size() + b.size() - 2 * pairs.size());
  return pairs;
}

// A camera of some rate whose stamps jitter, and which leaves images out, now and then for a while.
Stamps stamps_of_a_camera(Random& random, int64_t start, size_t count, int64_t interval, int64_t jitter) {
  Stamps stamps;
  int64_t t = start;
  for (size_t i = 0; i < count; ++i) {
    t += interval;
    if (random.below(10) == 0) t += interval * random.below(random.below(10) == 0 ? 60 : 3);
    const int64_t at = t + (jitter > 0 ? static_cast<int64_t>(random.below(static_cast<uint32_t>(jitter))) : 0);
    if (stamps.empty() || at > stamps.back()) stamps.push_back(at);
  }
  return stamps;
}

TEST(StampPairing, EqualsTheAssociationOfWholeLists) {
  Random random(5);
  for (int round = 0; round < 600; ++round) {
    const int64_t origin = random.below(2) == 0 ? 1'305'031'102'000'000'000 : 0;
    const int64_t intervals[] = {33 * kMs, 33 * kMs, 10 * kMs, 5 * kMs, kMs};
    const int64_t interval = intervals[random.below(5)];
    // Coarse stamps make ties.
    const int64_t grid = random.below(3) == 0 ? 5 * kMs : 1;
    Stamps sides[2];
    for (Stamps& side : sides) {
      side = stamps_of_a_camera(random, origin + random.below(40) * kMs, 120, interval, random.below(2) * interval / 2);
      for (int64_t& t : side) t = t / grid * grid;
      side.erase(std::unique(side.begin(), side.end()), side.end());
    }
    const int64_t lag = random.below(4) * 60 * kMs;
    const StampPairs stream = by_stream(sides[0], sides[1], lag), lists = by_lists(sides[0], sides[1]);
    const auto [at, expected] = std::mismatch(stream.begin(), stream.end(), lists.begin(), lists.end());
    EXPECT_EQ(stream.size(), lists.size()) << round;
    EXPECT_EQ(expected - lists.begin(), static_cast<long>(lists.size()))
        << "round " << round << ", colour " << expected->first << " goes with " << expected->second;
  }
}

TEST(StampPairing, TellsAPairAsSoonAsNothingNearerCanCome) {
  StampPairing pairing;
  pairing.add(StampPairing::colour, {100 * kMs, "c"});
  pairing.add(StampPairing::depth, {110 * kMs, "d"});
  EXPECT_FALSE(pairing.take()) << "a colour image at 110 would be nearer";
  pairing.add(StampPairing::colour, {133 * kMs, "c"});
  EXPECT_EQ(pairing.take()->depth.stamp_ns, 110 * kMs);
  pairing.add(StampPairing::depth, {133 * kMs, "d"});
  EXPECT_TRUE(pairing.take()) << "nothing is nearer than the same stamp";
}

TEST(StampPairing, StampsThatDoNotRiseAreRefused) {
  StampPairing pairing;
  EXPECT_TRUE(pairing.add(StampPairing::depth, {5, ""}));
  EXPECT_FALSE(pairing.add(StampPairing::depth, {5, ""}));
  EXPECT_FALSE(pairing.add(StampPairing::depth, {4, ""}));
  EXPECT_TRUE(pairing.add(StampPairing::colour, {4, ""}));
}

// What pairs of 100 images each at 30/s, with the stamps that `wrong` makes of the images' numbers.
struct Outcome {
  Stamps colours;
  int64_t refused = 0, unpaired = 0, behind = 0;
};
template <class Wrong>
Outcome with_stamps(const Wrong& wrong) {
  StampPairing pairing;
  Outcome outcome;
  const auto take = [&] {
    while (const auto pair = pairing.take()) outcome.colours.push_back(pair->colour.stamp_ns);
  };
  for (int64_t n = 0; n < 100; ++n)
    for (const StampPairing::Kind kind : {StampPairing::colour, StampPairing::depth}) {
      if (!pairing.add(kind, {wrong(kind, n), "image"})) ++outcome.refused;
      take();
    }
  outcome.behind = pairing.behind();
  pairing.close();
  take();
  outcome.unpaired = pairing.unpaired();
  EXPECT_TRUE(std::is_sorted(outcome.colours.begin(), outcome.colours.end()));
  EXPECT_EQ(2 * static_cast<int64_t>(outcome.colours.size()) + outcome.refused + outcome.unpaired, 200);
  return outcome;
}

TEST(StampPairing, OneStampFarAheadCostsTenImages) {
  constexpr int64_t kHour = 3600 * kNsPerSecond;
  for (const int64_t at : {0, 20})
    for (const auto& wrong_of : {std::pair{true, false}, {false, true}, {true, true}}) {
      const bool of_colour = wrong_of.first, of_depth = wrong_of.second;
      const Outcome outcome = with_stamps([&](StampPairing::Kind kind, int64_t n) {
        const bool wrong = n == at && (kind == StampPairing::colour ? of_colour : of_depth);
        return 33 * kMs * n + (wrong ? kHour : 0);
      });
      // A colour image that comes before the tenth depth image has no partner to wait for yet.
      EXPECT_EQ(outcome.colours.size(), of_depth ? 89U : 90U) << at << of_colour << of_depth;
      EXPECT_EQ(outcome.colours.back(), 33 * kMs * 99);
      EXPECT_EQ(outcome.refused, of_colour && of_depth ? 18 : 9);
      EXPECT_EQ(outcome.behind, 0);
    }
}

TEST(StampPairing, StampsThatStandStillOrFallAreNoClock) {
  const Outcome outcome = with_stamps([](StampPairing::Kind, int64_t n) {
    if (n < 50) return 33 * kMs * n;
    return n < 70 ? 33 * kMs : 33 * kMs * (1 - n);
  });
  EXPECT_EQ(outcome.colours.size(), 50U);
  EXPECT_EQ(outcome.refused, 100);
}

TEST(StampPairing, AClockThatIsSetBackIsToldOfAndTakenWhereItComesPastTheLastPair) {
  const auto set_back = [](int64_t by) {
    return with_stamps([=](StampPairing::Kind, int64_t n) { return 33 * kMs * (n < 50 ? n : n - by); });
  };
  const Outcome far = set_back(1000), near = set_back(20);
  EXPECT_EQ(far.colours.size(), 50U);
  EXPECT_EQ(far.behind, 100);
  EXPECT_EQ(near.colours.size(), 80U);
  EXPECT_EQ(near.behind, 0);
}

TEST(StampPairing, WhatWaitsIsBoundedWhenOneSideFallsSilent) {
  Stamps colour, depth{0};
  for (int64_t i = 0; i < 3000; ++i) colour.push_back(i * 33 * kMs);
  depth.push_back(colour.back());
  size_t most = 0;
  EXPECT_EQ(by_stream(colour, depth, 0, &most), by_lists(colour, depth));
  EXPECT_LT(most, 70u);
}

TEST(StampPairing, WhatWaitsIsBoundedForAnyStamps) {
  Stamps colour;
  for (int64_t i = 0; i < 5000; ++i) colour.push_back(i);
  size_t most = 0;
  by_stream(colour, {1'000'000}, 0, &most);
  EXPECT_LE(most, StampPairing::kMaxWaiting + 1);
}

}  // namespace
}  // namespace dkb
