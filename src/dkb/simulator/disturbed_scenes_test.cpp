// SPDX-License-Identifier: Apache-2.0
// What disturbances do to the images of a scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "dkb/simulator/disturbances.h"
#include "dkb/simulator/simulator.h"
#include "dkb/simulator/simulator_test_tools.h"

namespace dkb {
namespace {

SimulatorOptions tiny(const std::string& scene, int frames = 0) {
  return test::small_images(scene, frames, 160, 120);
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
      if (i % 13 != 0) continue;
      const SimulatedFrame f = s.render(i);
      EXPECT_GT(f.image.depth_timestamp, before);
      EXPECT_LT(std::abs(f.image.depth_timestamp - f.image.timestamp), 0.5 / std::max(rate, 30.0));
      before = f.image.depth_timestamp;
    }
  }
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
    for (int i = 75; i < 110; i += 5)
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

}  // namespace
}  // namespace dkb
