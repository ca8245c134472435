// SPDX-License-Identifier: Apache-2.0
// What the library tells of by events, and how they come.
#include <gtest/gtest.h>

#include "library_support.h"

namespace dkb::test {
namespace {

using Kind = Event::Kind;

class LibraryEvents : public ::testing::Test {
 protected:
  Slam slam_with(std::shared_ptr<KeyframePolicy> policy = nullptr) const {
    return Slam(world.camera(), Options(), Detectors::none(), std::move(policy));
  }

  WallWorld world{320, 240};
};

// Six frames, ten in the dark, back again, and then another place for good.
std::vector<Frame> eventful(const WallWorld& world) {
  std::vector<Frame> frames;
  for (int i = 0; i < 6; ++i) frames.push_back(world.frame(i, {.shift = i}));
  for (int i = 6; i < 16; ++i) frames.push_back(world.frame(i, {.dark = true}));
  for (int i = 16; i < 22; ++i) frames.push_back(world.frame(i, {.shift = i - 12}));
  for (int i = 22; i < 60; ++i) frames.push_back(world.frame(i, {.shift = i, .picture = 9}));
  return frames;
}

TEST_F(LibraryEvents, EventsTellWhatHappened) {
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

TEST_F(LibraryEvents, EventsComeByCallbackByExecutorOrByPolling) {
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

TEST_F(LibraryEvents, AnEmptyCallbackEndsItAndWhatACallbackThrowsLeavesProcess) {
  Slam slam = slam_with();
  slam.on_event([](const Event&) { throw InputError("enough of events"); });
  EXPECT_EQ(error_of([&] { slam.process(world.frame(0, {})); }), "enough of events");
  slam.on_event({});
  EXPECT_EQ(slam.statistics().frames, 1) << "the frame counts";
  EXPECT_TRUE(slam.process(world.frame(1, {})).tracked()) << "the system goes on";
  slam.process(world.frame(2, {.dark = true}));
  EXPECT_EQ(told(slam.take_events()), "2:lost ");
}

TEST_F(LibraryEvents, ACallbackMaySetAnother) {
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

TEST_F(LibraryEvents, ANewMapSaysWhatIsNotKnownOfIt) {
  Slam slam = slam_with(std::make_shared<EveryNth>(4));
  feed(slam, eventful(world));
  std::vector<std::string> texts;
  for (const Event& e : slam.take_events())
    if (e.kind == Kind::new_map) texts.push_back(e.text);
  EXPECT_EQ(texts, (std::vector<std::string>{
                       "map 1 begins",
                       "map 2 begins; how its world lies to that of map 1 is not known until they are joined"}));
}

TEST_F(LibraryEvents, ACallbackMayFeed) {
  Slam slam = slam_with();
  slam.on_event([&](const Event& e) {
    if (e.kind == Kind::lost) slam.reset();
  });
  for (int i = 0; i < 4; ++i) slam.process(world.frame(i, {.shift = i}));
  EXPECT_EQ(slam.process(world.frame(4, {.dark = true})).state, TrackingState::lost);
  EXPECT_EQ(slam.statistics().frames, 0);
  EXPECT_TRUE(slam.process(world.frame(0, {})).tracked());
}

TEST_F(LibraryEvents, WhatACallbackThrowsCostsNoOtherEvent) {
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

TEST_F(LibraryEvents, EventsThatNobodyTakesAreForgottenInTheEnd) {
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

}  // namespace
}  // namespace dkb::test
