// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/disturbances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numeric>

#include "dkb/simulator/simulator.h"
#include "dkb/simulator/simulator_test_tools.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

SimulatorOptions tiny(const std::string& scene, int frames = 0) {
  return test::small_images(scene, frames, 80, 60);
}

TEST(Rate, SamePoseAndPeopleAtTheSameTime) {
  SimulatorOptions o = tiny("crowd");
  const Simulator usual(o);
  o.rate = 10;
  const Simulator slow(o);
  EXPECT_EQ(usual.frames(), 300);
  EXPECT_EQ(slow.frames(), 100);  // both last 9.9 s and a little
  EXPECT_EQ(slow.camera().fps, 10);
  for (const int i : {0, 1, 50, 99}) {
    EXPECT_EQ(slow.stamp(i), usual.stamp(3 * i));
    const SimulatedFrame a = slow.render(i), b = usual.render(3 * i);
    EXPECT_EQ(a.stamp, b.stamp);
    EXPECT_EQ(a.world_from_cam.translation, b.world_from_cam.translation);
    EXPECT_EQ(a.mask, b.mask);
  }
}

TEST(Rate, StampsAreExactAndFramesAreCountedAtTheRate) {
  for (const double rate : {1.0, 7.0, 29.97, 60.0}) {
    SimulatorOptions o = tiny("loop", 40);
    o.rate = rate;
    const Simulator s(o);
    EXPECT_EQ(s.frames(), 40);
    double before = 0;
    for (int i = 0; i < 40; ++i) {
      EXPECT_NEAR(s.stamp(i) - s.stamp(0), i / rate, 6e-7) << rate;
      if (i % 19 != 0) continue;
      const SimulatedFrame f = s.render(i);
      EXPECT_GT(f.image.depth_timestamp, before);
      EXPECT_LT(std::abs(f.image.depth_timestamp - f.image.timestamp), 0.5 / std::max(rate, 30.0));
      before = f.image.depth_timestamp;
    }
  }
}

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

TEST(Dropouts, WhatIsLeftIsAsItWasWithoutThem) {
  SimulatorOptions o = tiny("crowd", 30);
  const Simulator all(o);
  o.dropouts = 0.5;
  const Simulator some(o);
  ASSERT_EQ(some.frames(), 15);
  const SimulatedFrame a = some.render(10);
  const int number = static_cast<int>(std::lround((some.stamp(10) - some.stamp(0)) * 30));
  EXPECT_GT(number, 10);
  const SimulatedFrame b = all.render(number);
  EXPECT_EQ(a.stamp, b.stamp);
  EXPECT_EQ(a.image.grey, b.image.grey);
  EXPECT_EQ(a.image.depth, b.image.depth);
}

TEST(Flicker, BrightnessStepsAndIsCut) {
  SimulatorOptions o = tiny("rush", 150);
  o.people = 0;  // the camera stands still, nothing moves
  const Simulator steady(o);
  o.flicker = true;
  const Simulator flickers(o), again(o);
  const double usual = test::mean_grey(steady.render(0).image.grey);
  EXPECT_NEAR(test::mean_grey(steady.render(149).image.grey), usual, 0.2);
  double before = test::mean_grey(flickers.render(0).image.grey), darkest = usual, brightest = usual;
  int jumps = 0;
  for (int i = 3; i < 150; i += 3) {  // the lamps are back at the same phase after three frames
    const SimulatedFrame f = flickers.render(i);
    const double now = test::mean_grey(f.image.grey);
    jumps += std::abs(now / before - 1) > 0.1;
    darkest = std::min(darkest, now);
    brightest = std::max(brightest, now);
    before = now;
  }
  EXPECT_GE(jumps, 3);  // one each 1.5 s or more often
  EXPECT_LE(jumps, 13);
  EXPECT_LT(darkest, 0.8 * usual);
  EXPECT_GT(brightest, 1.1 * usual);
  EXPECT_EQ(flickers.render(77).image.colour, again.render(77).image.colour);
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

TEST(StandStill, PeopleStandInViewFirstAndWalkAfterwards) {
  for (const char* scene : {"crowd", "straight", "rush", "cover", "room"}) {
    SimulatorOptions o = tiny(scene, 150);
    o.people = std::string(scene) == "cover" ? 1 : 3;
    o.stand_still = 2;
    const Simulator s(o);
    EXPECT_TRUE(s.notes().empty());
    const SimulatedFrame first = s.render(0), late = s.render(59), after = s.render(110);
    ASSERT_FALSE(first.movers.empty()) << scene;
    for (const SimulatedMover& m : late.movers) EXPECT_EQ(m.velocity_in_world.norm(), 0) << scene;
    for (const SimulatedMover& m : first.movers) EXPECT_EQ(m.velocity_in_world.norm(), 0) << scene;
    const double nearest = s.nearest_mover(0);
    EXPECT_GT(nearest, 0.5) << scene;
    double fastest = 0;
    for (int i = 75; i < 110; i += 10)
      for (const SimulatedMover& m : s.render(i).movers) fastest = std::max(fastest, m.velocity_in_world.norm());
    EXPECT_GT(fastest, 0.5) << scene;
  }
}

TEST(StandStill, WhoStandsSwaysByMillimetres) {
  // The camera of rush stands still, so the outlines move with the people alone.
  SimulatorOptions o = tiny("rush", 90);
  o.stand_still = 3;
  o.width = 640;
  o.height = 480;
  o.grey_noise = 0;
  const Simulator s(o);
  const GreyImage a = s.render(0).mask, b = s.render(45).mask;
  int people = 0, changed = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    people += a.data()[i] != 0;
    changed += a.data()[i] != b.data()[i];
  }
  EXPECT_GT(people, 10000);
  EXPECT_GT(changed, 0);
  EXPECT_LT(changed, 0.05 * people);
}

TEST(StandStill, SaysWhereNobodyIs) {
  SimulatorOptions o = tiny("room");
  o.stand_still = 5;
  const Simulator s(o);
  ASSERT_EQ(s.notes().size(), 1U);
  EXPECT_NE(s.notes()[0].find("--people"), std::string::npos);
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
