// SPDX-License-Identifier: Apache-2.0
// The library as its users see it: public headers alone, on frames with a known answer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "library_support.h"

namespace dkb::test {
namespace {

using Kind = Event::Kind;

TEST_F(Library, FollowsACameraExactly) {
  Slam slam = slam_with();
  const auto frames = world.walk(0, 20);
  for (int i = 0; i < 20; ++i) {
    const FrameResult r = slam.process(frames[static_cast<size_t>(i)]);
    ASSERT_TRUE(r.tracked()) << i;
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), 2e-3) << i;
    EXPECT_EQ(r.frame, i);
  }
}

// At the velocity between the first two frames, nothing of the first keeps its depth.
TEST_F(Library, ARecordingWhoseDepthIsOfAnotherTimeEndsNoRun) {
  for (int64_t away = 10; away < 10'000'000; away *= 3) {  // [s]
    Slam slam = slam_with();
    for (int i = 0; i < 4; ++i)
      EXPECT_NO_THROW(slam.process(world.frame(i, {.shift = i}, away * 1'000'000'000))) << away << " s, frame " << i;
    EXPECT_NO_THROW(slam.finish());
  }
}

TEST_F(Library, EveryFrameSaysWhatItsTimeWentInto) {
  Slam slam = slam_with();
  for (const Frame& frame : world.walk(0, 5)) {
    const FrameResult r = slam.process(frame);
    double tracking = 0, features = 0;
    for (const StageTime& s : r.stages) {
      if (s.stage == "tracking") tracking = s.ms;
      if (s.stage == "features") features = s.ms;
    }
    EXPECT_NEAR(tracking, r.tracking_ms, 1e-3 * r.tracking_ms);
    EXPECT_GT(features, 0);
    EXPECT_LT(features, tracking);
  }
}

// Frames a millisecond apart, which no machine tracks in time.
std::vector<Frame> rush(const WallWorld& world) {
  std::vector<Frame> frames;
  for (const Frame& frame : world.walk(0, 60)) {
    const int64_t stamp = int64_t{1'000'000'000} + 1'000'000 * static_cast<int64_t>(frames.size());
    frames.push_back(Frame(frame.image(), stamp, stamp));
  }
  return frames;
}

TEST_F(Library, ARealTimeRunThatIsLateSaysWhatItLeavesOut) {
  Options options;
  options.realtime = true;
  Slam slam = slam_with(nullptr, options);
  size_t first = 0, last = 0;
  for (const Frame& frame : rush(world)) {
    const FrameResult r = slam.process(frame);
    last = r.features.size();
    if (r.frame == 0) first = last;
  }
  EXPECT_LT(last, 0.6 * static_cast<double>(first));
  EXPECT_GT(slam.statistics().degraded_s.at("detection"), 0);
  EXPECT_GT(slam.statistics().degraded_s.at("features"), 0);
  const auto events = slam.take_events();
  EXPECT_EQ(std::count_if(events.begin(), events.end(), [](const Event& e) { return e.kind == Kind::warning; }), 1);
}

TEST_F(Library, ARunThatIsNotInRealTimeLeavesNothingOutHoweverLate) {
  Slam slam = slam_with();
  for (const Frame& frame : rush(world)) EXPECT_GT(slam.process(frame).features.size(), 700U);
  EXPECT_TRUE(slam.statistics().degraded_s.empty());
  for (const Event& event : slam.take_events()) EXPECT_NE(event.kind, Kind::warning);
}

TEST_F(Library, TrackingThatCannotBeginIsToldOnce) {
  Slam slam = slam_with();
  for (int i = 0; i < 70; ++i)
    EXPECT_EQ(slam.process(world.frame(i, {.dark = true})).state, TrackingState::initialising);
  const std::vector<Event> events = slam.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].kind, Kind::warning);
  EXPECT_EQ(events[0].frame, 29);
  EXPECT_NE(events[0].text.find("100 features with depth"), std::string::npos) << events[0].text;
  EXPECT_NE(events[0].text.find("are they black, covered or out of focus?"), std::string::npos) << events[0].text;
}

TEST_F(Library, DepthThatIsMissingIsToldOnceAlsoInAMap) {
  const auto without_depth = [&](int i) { return world.frame(i, {.flat = true}); };
  const auto warnings_of = [](Slam& slam) {
    std::vector<std::string> texts;
    for (const Event& event : slam.take_events())
      if (event.kind == Kind::warning) texts.push_back(event.text);
    return texts;
  };
  Slam never = slam_with();
  for (int i = 0; i < 40; ++i) never.process(without_depth(i));
  const auto first = warnings_of(never);
  ASSERT_EQ(first.size(), 1U);
  EXPECT_NE(first[0].find("(no pixel has a depth of "), std::string::npos) << first[0];
  Slam slam = slam_with();
  for (int i = 0; i < 5; ++i) slam.process(world.frame(i, {}));
  for (int i = 5; i < 75; ++i) slam.process(without_depth(i));
  const auto later = warnings_of(slam);
  ASSERT_EQ(later.size(), 1U);
  EXPECT_NE(later[0].find("no depth: none of the last 30 frames has any"), std::string::npos) << later[0];
}

// Pause and localise.

TEST_F(Library, WhilePausedNothingIsLookedAt) {
  Slam slam = slam_with();
  feed(slam, world.walk(0, 6));
  slam.finish();
  const std::string before = bytes_of(slam);
  slam.pause(true);
  for (int i = 6; i < 9; ++i) {
    const FrameResult r = slam.process(world.frame(i, {.dark = true}));
    EXPECT_EQ(r.state, TrackingState::paused);
    EXPECT_EQ(r.frame, 5) << "the last one that counts";
    EXPECT_EQ(r.stamp_ns, world.frame(i, {}).stamp_ns());
    EXPECT_FALSE(r.tracked() || r.world_from_cam || r.keyframe);
  }
  EXPECT_EQ(bytes_of(slam), before);
  slam.pause(false);
  const FrameResult r = slam.process(world.frame(9, {.shift = 6}));
  EXPECT_TRUE(r.tracked());
  EXPECT_EQ(r.frame, 6) << "frames that were not looked at do not count";
}

TEST_F(Library, LocaliseOnlyMakesNoKeyframesAndNoMaps) {
  Slam slam = slam_with(std::make_shared<EveryNth>(3));
  feed(slam, world.walk(0, 10));
  slam.finish();
  const int keyframes = slam.map().keyframe_count();
  const size_t points = slam.map().point_count();
  slam.take_events();
  slam.localize_only(true);
  for (int i = 10; i < 20; ++i) EXPECT_TRUE(slam.process(world.frame(i, {.shift = i})).tracked());
  for (int i = 20; i < 60; ++i) EXPECT_FALSE(slam.process(world.frame(i, {.shift = i, .picture = 9})).tracked());
  slam.finish();
  EXPECT_EQ(slam.map().keyframe_count(), keyframes);
  EXPECT_EQ(slam.map().point_count(), points);
  EXPECT_EQ(told(slam.take_events()), "20:lost ");
  slam.localize_only(false);
  slam.process(world.frame(60, {.shift = 10}));
  for (int i = 61; i < 66; ++i) slam.process(world.frame(i, {.shift = i - 50}));
  slam.finish();
  EXPECT_GT(slam.map().keyframe_count(), keyframes);
}

TEST_F(Library, LocalisingWithoutAMapIsToldAfterASecond) {
  Slam slam = slam_with();
  slam.localize_only(true);
  for (int i = 0; i < 60; ++i) slam.process(world.frame(i, {.shift = i}));
  const auto events = slam.take_events();
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].frame, 29);
  EXPECT_EQ(events[0].text, "there is no map to localise in; load one, or end localize_only to make one");
}

TEST_F(Library, TheSwitchesOutliveAReset) {
  Slam slam = slam_with();
  slam.localize_only(true);
  slam.explain_keyframes(true);
  slam.reset();
  EXPECT_EQ(slam.process(world.frame(0, {})).state, TrackingState::initialising);
  slam.localize_only(false);
  slam.reset();
  EXPECT_EQ(slam.process(world.frame(0, {})).keyframe_explanation, "keyframe (first): the map starts here");
}

// A rule of the user's for keyframes.

TEST_F(Library, AKeyframeRuleIsToldPlainNumbers) {
  struct Counting final : KeyframePolicy {
    KeyframeAnswer decide(const KeyframeQuery& q) override {
      close = std::max(close, q.tracked_close_points);
      EXPECT_LE(q.tracked_close_points, static_cast<int>(q.points.size()));
      EXPECT_LE(q.reference_points, 300);
      return {};
    }
    int close = 0;
  };
  const auto rule = std::make_shared<Counting>();
  Options few;
  few.set("features.count", "300");
  Slam slam(world.camera(), few, {}, rule);
  for (int i = 0; i < 8; ++i) slam.process(world.frame(i, {.shift = i}));
  EXPECT_GT(rule->close, 50);
}

TEST_F(Library, AKeyframeRuleOfOnesOwnDecides) {
  const auto policy = std::make_shared<EveryNth>(4);
  Slam slam = slam_with(policy);
  slam.explain_keyframes(true);
  EXPECT_EQ(policy->resets, 1);
  for (const Frame& frame : world.walk(0, 13)) {
    const FrameResult r = slam.process(frame);
    EXPECT_EQ(r.keyframe, r.frame % 4 == 0) << r.frame;
    if (r.frame == 6) {
      EXPECT_EQ(r.keyframe_explanation, "no keyframe: 2 frames");
    }
    if (r.frame == 8) {
      EXPECT_EQ(r.keyframe_explanation, "keyframe (own): 4 frames");
    }
  }
  EXPECT_EQ(slam.statistics().keyframe_rules.at("own"), 3);
  slam.reset();
  EXPECT_EQ(policy->resets, 2);
}

TEST_F(Library, WhatARuleThrowsEndsTheWorldUntilAReset) {
  const auto frames = world.walk(0, 12);
  const std::function<void()> faults[] = {[] { throw std::runtime_error("the rule broke"); },
                                          [] { throw InputError("the rule refused"); }, [] { throw 42; }};
  for (const auto& fault : faults) {
    const auto policy = std::make_shared<EveryNth>(3);
    Slam slam = slam_with(policy), fresh = slam_with(std::make_shared<EveryNth>(3));
    feed(slam, {frames.begin(), frames.begin() + 5});
    policy->throws = fault;
    const std::string error = error_of([&] { slam.process(frames[5]); });
    EXPECT_NE(error, "no error");
    policy->throws = nullptr;
    EXPECT_EQ(error_of([&] { slam.process(frames[6]); }), error) << "and every call from then on";
    EXPECT_EQ(error_of([&] { slam.process(frames[5]); }), error) << "whatever its frame";
    EXPECT_EQ(error_of([&] { slam.finish(); }), error);
    EXPECT_EQ(slam.statistics().frames, 5) << "what was known can be read";
    EXPECT_GT(slam.map().point_count(), 0U);
    slam.reset();
    EXPECT_EQ(run(slam, frames), run(fresh, frames));
  }
}

// Stamps.

TEST_F(Library, StampsThatStandStillOrGoBackAreRefusedUntilAReset) {
  Slam slam = slam_with(), undisturbed = slam_with();
  const auto frames = world.walk(0, 12);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i >= 6) {
      EXPECT_NE(error_of([&] { slam.process(frames[i - 1]); }).find("is not after the one before it"),
                std::string::npos);
      EXPECT_NE(error_of([&] { slam.process(frames[0]); }).find("call reset()"), std::string::npos);
    }
    slam.process(frames[i]);
    undisturbed.process(frames[i]);
  }
  slam.finish();
  undisturbed.finish();
  EXPECT_EQ(bytes_of(slam), bytes_of(undisturbed)) << "refused frames are not counted";
  slam.reset();
  EXPECT_TRUE(slam.process(frames[0]).tracked());
  undisturbed.save_map(folder / "a.dkb");
  slam.load_map(folder / "a.dkb");
  EXPECT_EQ(error_of([&] { slam.process(frames[0]); }), "no error");
}

TEST_F(Library, StampsMayBeNegativeAndFarApart) {
  Slam slam = slam_with();
  for (int i = 0; i < 4; ++i) {
    const Frame f = world.frame(i, {.shift = i});
    FrameInput input;
    input.stamp_ns = f.stamp_ns() - 1'000'000'000;
    input.colour = f.grey(), input.depth = f.depth();
    EXPECT_TRUE(slam.process(input).tracked()) << i;
  }
  FrameInput later;
  const Frame f = world.frame(4, {.shift = 4});
  later.stamp_ns = INT64_MAX;
  later.colour = f.grey(), later.depth = f.depth();
  EXPECT_EQ(error_of([&] { slam.process(later); }), "no error");
}

// Frames before it are refused from then on.
TEST_F(Library, AStampThatLeapsIsTold) {
  Slam slam = slam_with();
  feed(slam, world.walk(0, 6));
  slam.take_events();
  const Frame late = world.frame(306, {.shift = 6});
  EXPECT_TRUE(slam.process(late).frame == 6);
  EXPECT_NE(error_of([&] { slam.process(world.frame(7, {.shift = 7})); }), "no error");
  std::string told;
  for (const Event& e : slam.take_events())
    if (e.kind == Kind::warning) told += e.text;
  EXPECT_EQ(
      told,
      "the stamp is 10 s after the one before it; if the clock leapt, call reset(): frames with earlier stamps are "
      "refused");
}

TEST_F(Library, WhatIsSkippedInAPauseIsNoLeapOfTheStamps) {
  Slam slam = slam_with();
  feed(slam, world.walk(0, 6));
  slam.pause(true);
  for (int i = 6; i < 400; i += 50) slam.process(world.frame(i, {.shift = 6}));
  slam.pause(false);
  feed(slam, {world.frame(400, {.shift = 6}), world.frame(401, {.shift = 7})});
  for (const Event& e : slam.take_events()) EXPECT_NE(e.kind, Kind::warning) << e.text;
}

TEST_F(Library, EmptyBracesAreTheDefaultOptions) {
  Slam slam(world.camera(), {}, Detectors::none());
  EXPECT_EQ(slam.options().preset(), "default");
}

TEST_F(Library, SettingsOutOfRangeAreRefused) {
  Camera camera = world.camera();
  camera.width = 3;
  EXPECT_THROW(Slam{camera}, InvalidOption);
  Detectors detectors = Detectors::none();
  detectors.schedule.every = 0;
  EXPECT_THROW(Slam(world.camera(), Options(), detectors), InvalidOption);
  Options options;
  options.base_from_cam.rotation.coeffs() *= 2;
  EXPECT_NE(error_of([&] { Slam(world.camera(), options); }).find("base_from_cam: "), std::string::npos);
}

// Maps that are not joined.

TEST_F(Library, TheDenseMapIsThatOfTheLastPosesWorld) {
  Options options;
  options.dense_map = true;
  options.tracking.new_map_after = 0.3;
  Slam slam = slam_with(std::make_shared<EveryNth>(4), options);
  int views = 0;
  for (int i = 0; i < 60; ++i) {
    const FrameResult r = slam.process(world.frame(i, {.shift = i, .picture = i < 10 ? 1U : 9U}));
    views += r.keyframe && r.map == 1;
  }
  slam.finish();
  ASSERT_EQ(slam.statistics().maps, 2);
  ASSERT_GT(views, 5);
  EXPECT_EQ(slam.dense_map().views, views);
  std::vector<int> of_map(2);
  for (const PointInfo& p : slam.map().points()) ++of_map.at(static_cast<size_t>(p.map));
  EXPECT_GT(of_map[0], 100);
  EXPECT_GT(of_map[1], 100);
}

}  // namespace
}  // namespace dkb::test
