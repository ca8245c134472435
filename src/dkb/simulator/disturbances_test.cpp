// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/disturbances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dkb/simulator/simulator.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

TEST(Dropouts, ShareIsExactAndTheFirstFrameStays) {
  for (const double share : {0.0, 0.01, 0.3, 0.9})
    for (uint64_t seed = 1; seed < 20; ++seed) {
      const std::vector<int> left = sim::frames_left(300, share, seed);
      EXPECT_EQ(left.size(), 300 - static_cast<size_t>(std::lround(300 * share)));
      EXPECT_EQ(left.front(), 0);
      EXPECT_TRUE(std::is_sorted(left.begin(), left.end()));
      EXPECT_EQ(left, sim::frames_left(300, share, seed));
    }
  EXPECT_NE(sim::frames_left(300, 0.3, 1), sim::frames_left(300, 0.3, 2));
  EXPECT_EQ(sim::frames_left(1, 0.9, 1), std::vector<int>{0});
}

TEST(Dropouts, AreSingleFramesAndBursts) {
  const std::vector<int> left = sim::frames_left(3000, 0.1, 5);
  int single = 0, bursts = 0, longest = 0;
  for (size_t i = 1; i < left.size(); ++i) {
    const int missing = left[i] - left[i - 1] - 1;
    single += missing == 1;
    bursts += missing > 1;
    longest = std::max(longest, missing);
  }
  EXPECT_GT(single, 20);
  EXPECT_GT(bursts, 20);
  EXPECT_GE(longest, 7);
}

TEST(Flicker, LampsAreBandsButForAShutterOfTheirPeriod) {
  const sim::Flicker f(10, 3);
  double low = 2, high = 0;
  for (double t = 0; t < 0.01; t += 0.0005) {
    low = std::min(low, f.lamps(t, 0.014));
    high = std::max(high, f.lamps(t, 0.014));
    EXPECT_NEAR(f.lamps(t, 0.010), 1, 1e-9);
  }
  // 0.3 sin(1.4 pi) / (1.4 pi) either way.
  EXPECT_NEAR(high - low, 2 * 0.3 * 0.2163, 0.004);
}

TEST(Disturbances, BadValuesNameTheOption) {
  const auto message = [](void (*change)(SimulatorOptions*)) -> std::string {
    SimulatorOptions o;
    change(&o);
    try {
      o.check();
    } catch (const InvalidOption& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(message([](SimulatorOptions* o) { o->rate = 0.5; }).find("--rate"), std::string::npos);
  EXPECT_NE(message([](SimulatorOptions* o) { o->rate = NAN; }).find("--rate"), std::string::npos);
  EXPECT_NE(message([](SimulatorOptions* o) { o->dropouts = 1; }).find("--dropouts"), std::string::npos);
  EXPECT_NE(message([](SimulatorOptions* o) { o->stand_still = -1; }).find("--stand-still"), std::string::npos);
  EXPECT_NE(message([](SimulatorOptions* o) { o->rate = 1, o->frames = 100000; }).find("--frames"), std::string::npos);
}

}  // namespace
}  // namespace dkb
