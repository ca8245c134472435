// SPDX-License-Identifier: Apache-2.0
// The library as its users see it: public headers alone, on frames with a known answer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <thread>

#include "library_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;
using Kind = Event::Kind;

class Library : public ::testing::Test {
 protected:
  Library()
      : folder(fs::path(::testing::TempDir()) / ("dkb_library_" + std::to_string(::getpid()) +
                                                 ::testing::UnitTest::GetInstance()->current_test_info()->name())) {
    fs::remove_all(folder);
    fs::create_directories(folder);
  }
  ~Library() override { fs::remove_all(folder); }
  Slam slam_with(std::shared_ptr<KeyframePolicy> policy = nullptr, const Options& options = Options()) const {
    return Slam(world.camera(), options, Detectors::none(), std::move(policy));
  }

  WallWorld world{320, 240};
  fs::path folder;
};

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

// What is mapped becomes visible with the next frame's beginning, and in real time only if it is done by then.
TEST_F(Library, AMapSavedInRealTimeHoldsWhatShouldHaveBeenMappedByNow) {
  Options options;
  options.realtime = true;
  Slam slam = slam_with(nullptr, options);
  const std::string file = testing::TempDir() + "dkb_saved_in_real_time.dkb";
  for (const Frame& frame : world.walk(0, 4)) slam.process(frame);  // the first keyframe is due after 0.1 s
  EXPECT_EQ(slam.statistics().keyframes, 0);
  slam.save_map(file);
  EXPECT_EQ(slam.statistics().keyframes, 1);
  Slam other = slam_with();
  other.load_map(file);
  EXPECT_EQ(other.statistics().keyframes, 1);
  std::filesystem::remove(file);
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
}

// Motion priors.

TEST_F(Library, APriorGuidesAJumpThatTheMotionModelMisses) {
  // The wall's picture repeats itself: a jump by one period looks like standing still.
  const int period = 48;
  const WallWorld repeating(320, 240, period);
  const double jump = repeating.camera_x(period);
  Options options;
  options.readout.estimate = false;  // a picture of the wall is made at once, and a jump is no motion while it is read
  for (const bool told : {false, true}) {
    Slam slam(repeating.camera(), options, Detectors::none());
    for (int i = 0; i < 6; ++i) ASSERT_TRUE(slam.process(repeating.frame(i, {})).tracked());
    Frame frame = repeating.frame(6, {.shift = period});
    MotionPrior prior;
    prior.previous_from_current.translation.x() = jump;
    if (told) frame.set_prior(prior);
    const FrameResult r = slam.process(frame);
    ASSERT_TRUE(r.tracked());
    EXPECT_NEAR(r.world_from_cam->translation.x(), told ? jump : 0, 0.005);
  }
}

TEST_F(Library, AWrongPriorIsOverruledByTheImages) {
  Slam slam = slam_with();
  for (int i = 0; i < 10; ++i) {
    Frame frame = world.frame(i, {.shift = i});
    MotionPrior prior;
    prior.previous_from_current.translation = {0.4, -0.3, 0.2};
    frame.set_prior(prior);
    const FrameResult r = slam.process(frame);
    ASSERT_TRUE(r.tracked()) << i;
    EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(i), 3e-3);
  }
}

TEST_F(Library, APriorThatIsNoNumberIsRefusedAndHarmsNothing) {
  Slam slam = slam_with(), undisturbed = slam_with();
  const auto frames = world.walk(0, 12);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i == 5) {
      MotionPrior prior;
      prior.previous_from_current.translation.z() = std::numeric_limits<double>::quiet_NaN();
      Frame bad = frames[i];
      EXPECT_NE(error_of([&] {
                  bad.set_prior(prior);
                  slam.process(bad);
                }).find("motion prior"),
                std::string::npos);
    }
    slam.process(frames[i]);
    undisturbed.process(frames[i]);
  }
  slam.finish();
  undisturbed.finish();
  EXPECT_EQ(bytes_of(slam), bytes_of(undisturbed));
}

// Events.

std::string told(const std::vector<Event>& events) {
  std::string line;
  for (const Event& e : events)
    if (e.kind != Kind::keyframe) line += std::to_string(e.frame) + ":" + name_of(e.kind) + " ";
  return line;
}

// Six frames, ten in the dark, back again, and then another place for good.
std::vector<Frame> eventful(const WallWorld& world) {
  std::vector<Frame> frames;
  for (int i = 0; i < 6; ++i) frames.push_back(world.frame(i, {.shift = i}));
  for (int i = 6; i < 16; ++i) frames.push_back(world.frame(i, {.dark = true}));
  for (int i = 16; i < 22; ++i) frames.push_back(world.frame(i, {.shift = i - 12}));
  for (int i = 22; i < 60; ++i) frames.push_back(world.frame(i, {.shift = i, .picture = 9}));
  return frames;
}

TEST_F(Library, EventsTellWhatHappened) {
  Slam slam = slam_with(std::make_shared<EveryNth>(4));
  std::vector<Event> events;
  std::vector<int> keyframes;
  for (const Frame& frame : eventful(world)) {
    const FrameResult r = slam.process(frame);
    if (r.keyframe) keyframes.push_back(r.frame);
    EXPECT_EQ(r.map, r.tracked() && r.frame >= 53 ? 1 : 0) << r.frame;
    for (const Event& e : slam.take_events()) {
      EXPECT_EQ(e.frame, r.frame);
      EXPECT_EQ(e.stamp_ns, r.stamp_ns);
      if (e.kind == Kind::keyframe) {
        EXPECT_EQ(e.keyframe, r.reference_keyframe);
      }
      events.push_back(e);
    }
  }
  // A map is begun a second after the loss: 31 frames of 33,333,333 ns.
  EXPECT_EQ(told(events), "0:new_map 6:lost 17:found 22:lost 53:new_map 53:found ");
  std::vector<int> announced;
  for (const Event& e : events)
    if (e.kind == Kind::keyframe) announced.push_back(e.frame);
  EXPECT_EQ(announced, keyframes);
  EXPECT_GE(announced.size(), 5U);
  EXPECT_EQ(slam.statistics().maps, 2);
  EXPECT_EQ(slam.trajectory().front().map, 0);
  EXPECT_EQ(slam.trajectory().back().map, 1);
  EXPECT_TRUE(slam.take_events().empty()) << "they were taken";
}

TEST_F(Library, EventsComeByCallbackByExecutorOrByPolling) {
  const auto frames = eventful(world);
  Slam polled = slam_with(), called = slam_with(), deferred = slam_with();
  std::vector<Event> by_polling, by_callback, by_executor;
  std::vector<std::function<void()>> tasks;
  called.on_event([&](const Event& e) { by_callback.push_back(e); });
  deferred.on_event([&](const Event& e) { by_executor.push_back(e); },
                    [&](std::function<void()> task) { tasks.push_back(std::move(task)); });
  for (const Frame& frame : frames) {
    polled.process(frame);
    const size_t before = by_callback.size();
    const FrameResult r = called.process(frame);
    for (size_t i = before; i < by_callback.size(); ++i)
      EXPECT_EQ(by_callback[i].frame, r.frame) << "before it returns";
    deferred.process(frame);
  }
  by_polling = polled.take_events();
  EXPECT_TRUE(called.take_events().empty()) << "nothing while a callback is set";
  EXPECT_TRUE(by_executor.empty()) << "the executor has not run yet";
  for (const auto& task : tasks) task();
  EXPECT_EQ(told(by_callback), told(by_polling));
  EXPECT_EQ(told(by_executor), told(by_polling));
  EXPECT_EQ(by_callback.size(), by_polling.size());
}

TEST_F(Library, AnEmptyCallbackEndsItAndWhatACallbackThrowsLeavesProcess) {
  Slam slam = slam_with();
  slam.on_event([](const Event&) { throw InputError("enough of events"); });
  EXPECT_EQ(error_of([&] { slam.process(world.frame(0, {})); }), "enough of events");
  slam.on_event({});
  EXPECT_EQ(slam.statistics().frames, 1) << "the frame counts";
  EXPECT_TRUE(slam.process(world.frame(1, {})).tracked()) << "the system goes on";
  slam.process(world.frame(2, {.dark = true}));
  EXPECT_EQ(told(slam.take_events()), "2:lost ");
}

TEST_F(Library, ACallbackMaySetAnother) {
  Slam slam = slam_with();
  int first = 0, second = 0;
  slam.on_event([&](const Event&) {
    ++first;
    slam.on_event([&](const Event&) { ++second; });
  });
  slam.process(world.frame(0, {}));  // a new map, and its first keyframe
  EXPECT_EQ(first, 2);
  EXPECT_EQ(second, 0) << "from the next frame on";
  slam.process(world.frame(1, {.dark = true}));
  EXPECT_EQ(first, 2);
  EXPECT_EQ(second, 1);
}

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

TEST_F(Library, WhatACallbackThrowsCostsNoOtherEvent) {
  Slam polled = slam_with(), called = slam_with();
  std::vector<Event> seen;
  called.on_event([&](const Event& e) {
    seen.push_back(e);
    throw InputError("number " + std::to_string(seen.size()));
  });
  for (const Frame& frame : eventful(world)) {  // some have two events
    polled.process(frame);
    const size_t before = seen.size();
    const std::string error = error_of([&] { called.process(frame); });
    if (seen.size() > before) {
      EXPECT_EQ(error, "number " + std::to_string(before + 1));
    }
  }
  const std::vector<Event> expected = polled.take_events();
  EXPECT_EQ(told(seen), told(expected));
  EXPECT_EQ(seen.size(), expected.size());
}

TEST_F(Library, EventsThatNobodyTakesAreForgottenInTheEnd) {
  Slam slam(world.camera(), Options(), [] {
    Detectors detectors = Detectors::none();
    detectors.prompt.push_back(
        std::make_shared<FunctionDetector>([calls = 0](const DetectorInput&) mutable -> Detections {
          if (++calls % 2 == 0) return {};  // else it would be given up
          throw std::runtime_error("out of order " + std::to_string(calls));
        }));
    return detectors;
  }());
  for (int i = 0; i < 29; ++i) slam.process(world.frame(i, {.dark = true}));
  const auto events = slam.take_events();
  ASSERT_EQ(events.size(), 15U);
  for (size_t i = 0; i < events.size(); ++i)
    EXPECT_EQ(events[i].text, "detector function failed: out of order " + std::to_string(2 * i + 1));
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

TEST_F(Library, AMapTaskWritesTheMapOfItsMoment) {
  Slam slam = slam_with(std::make_shared<EveryNth>(3));
  feed(slam, world.walk(0, 10));
  slam.finish();
  slam.save_map(folder / "now.dkb");
  const auto task = slam.save_map_task();
  feed(slam, world.walk(10, 30));
  slam.finish();
  slam.save_map(folder / "later.dkb");
  std::thread([&] { task(folder / "task.dkb"); }).join();
  const auto bytes = [&](const char* name) {
    std::ifstream file(folder / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  EXPECT_TRUE(bytes("task.dkb") == bytes("now.dkb"));
  EXPECT_FALSE(bytes("task.dkb") == bytes("later.dkb"));
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

// Maps on disk.

TEST_F(Library, AMapIsSavedAndLoaded) {
  Slam first = slam_with();
  feed(first, world.walk(0, 15));
  first.finish();
  first.save_map(folder / "a.dkb");
  Slam second = slam_with();
  feed(second, world.walk(40, 50));  // somewhere else, and later
  second.load_map(folder / "a.dkb");
  EXPECT_EQ(second.map().point_count(), first.map().point_count());
  EXPECT_EQ(second.statistics().frames, 0);
  EXPECT_TRUE(second.trajectory().empty());
  for (const KeyframeInfo& k : second.map().keyframes()) EXPECT_LT(k.frame, 0);
  EXPECT_FALSE(second.process(world.frame(3, {.shift = 9})).tracked()) << "it is lost until it is found";
  FrameResult r = second.process(world.frame(4, {.shift = 10}));
  EXPECT_EQ(r.state, TrackingState::relocalised);
  EXPECT_NEAR(r.world_from_cam->translation.x(), world.camera_x(10), 5e-3) << "in the first one's world";
}

TEST_F(Library, AKeyframeRuleIsToldHowLongAgoTheLastKeyframeOfALoadedMapWas) {
  struct Listening final : KeyframePolicy {
    KeyframeAnswer decide(const KeyframeQuery& q) override {
      asked.push_back(q);
      return {};
    }
    std::vector<KeyframeQuery> asked;
  };
  Slam first = slam_with();
  feed(first, world.walk(0, 15));
  first.finish();
  first.save_map(folder / "a.dkb");
  const auto rule = std::make_shared<Listening>();
  Slam second(world.camera(), Options(), Detectors::none(), rule);
  second.load_map(folder / "a.dkb");
  second.process(world.frame(20, {.shift = 9}));
  second.process(world.frame(21, {.shift = 10}));
  ASSERT_FALSE(rule->asked.empty());
  const KeyframeQuery& q = rule->asked.front();
  const auto keyframes = second.map().keyframes();
  EXPECT_TRUE(std::any_of(keyframes.begin(), keyframes.end(),
                          [&q](const KeyframeInfo& k) {
                            return q.frames_since_keyframe == q.frame - k.frame &&
                                   std::abs(q.seconds_since_keyframe -
                                            1e-9 * static_cast<double>(q.stamp_ns - k.stamp_ns)) < 1e-6;
                          }))
      << q.frames_since_keyframe << " frames, " << q.seconds_since_keyframe << " s";
}

TEST_F(Library, AMapThatDoesNotFitLeavesAllAsItWas) {
  Camera other = world.camera();
  other.fx += 1;
  Slam elsewhere(other, Options(), Detectors::none());
  for (int i = 0; i < 8; ++i) {
    const Frame f = world.frame(i, {.shift = i});
    FrameInput input;
    input.stamp_ns = f.stamp_ns();
    input.colour = f.grey(), input.depth = f.depth();
    elsewhere.process(input);
  }
  elsewhere.finish();
  ASSERT_GT(elsewhere.map().point_count(), 100U);
  elsewhere.save_map(folder / "other.dkb");
  std::ofstream(folder / "broken.dkb") << "not a map";

  Slam slam = slam_with(), undisturbed = slam_with();
  const auto frames = world.walk(0, 16);
  for (size_t i = 0; i < frames.size(); ++i) {
    if (i == 8) {
      EXPECT_NE(error_of([&] { slam.load_map(folder / "other.dkb"); }).find("another camera"), std::string::npos);
      EXPECT_NE(error_of([&] { slam.load_map(folder / "broken.dkb"); }).find("broken.dkb"), std::string::npos);
      EXPECT_NE(error_of([&] { slam.load_map(folder / "none.dkb"); }).find("none.dkb"), std::string::npos);
      EXPECT_NE(error_of([&] { slam.save_map(folder / "no" / "folder.dkb"); }), "no error");
    }
    slam.process(frames[i]);
    undisturbed.process(frames[i]);
  }
  slam.finish();
  undisturbed.finish();
  EXPECT_EQ(bytes_of(slam), bytes_of(undisturbed));
}

// A rule of the user's for keyframes.

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

TEST_F(Library, SettingsOutOfRangeAreRefused) {
  Camera camera = world.camera();
  camera.width = 3;
  EXPECT_THROW(Slam{camera}, InvalidOption);
  Detectors detectors = Detectors::none();
  detectors.schedule.every = 0;
  EXPECT_THROW(Slam(world.camera(), Options(), detectors), InvalidOption);
}

}  // namespace
}  // namespace dkb::test
