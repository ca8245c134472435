// SPDX-License-Identifier: Apache-2.0
// Detectors of the user's own, prompt and slow, by the public headers alone.
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <future>

#include "library_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;
using Gives = DepthDetector::Gives;
constexpr Gives kGives[] = {Gives::boxes, Gives::masks, Gives::both};

class LibraryDetectors : public ::testing::Test {
 protected:
  static constexpr int kEnters = 8;  // the frame from which on somebody is in view
  static Detectors prompt(Gives gives) {
    Detectors detectors = Detectors::none();
    detectors.prompt.push_back(std::make_shared<DepthDetector>(gives));
    return detectors;
  }
  static Detectors slow(std::shared_ptr<Detector> detector, DetectionSchedule schedule = {}) {
    Detectors detectors = Detectors::none();
    detectors.slow = std::move(detector);
    detectors.schedule = schedule;
    return detectors;
  }
  static Detectors slow(Gives gives, DetectionSchedule schedule = {}) {
    return slow(std::make_shared<DepthDetector>(gives), schedule);
  }
  // Every kind of detector, and all together.
  static std::vector<std::function<Detectors()>> every_kind() {
    std::vector<std::function<Detectors()>> kinds = {[] { return Detectors::none(); }, [] { return Detectors(); }};
    for (const Gives gives : kGives) {
      kinds.push_back([gives] { return prompt(gives); });
      kinds.push_back([gives] { return slow(gives, {.every = 3, .latency = 2}); });
    }
    kinds.push_back([] {
      Detectors all = slow(Gives::masks, {.every = 4, .latency = 3});
      all.motion = true;
      all.prompt.push_back(std::make_shared<DepthDetector>(Gives::boxes));
      return all;
    });
    return kinds;
  }
  Slam slam_with(Detectors detectors, Options options = Options()) const {
    return Slam(world.camera(), options, std::move(detectors), std::make_shared<EveryNth>(3));
  }
  // Throws from the fourth image on; counts in `asked`.
  static std::shared_ptr<Detector> failing_after_three(int* asked) {
    return std::make_shared<FunctionDetector>([asked](const DetectorInput&) -> Detections {
      if (++*asked > 3) throw std::runtime_error("no memory left");
      return {};
    });
  }
  void expect_motion_goes_on(Slam& slam, const int& asked) const {
    int masked = 0;
    for (const Frame& frame : people) masked += !slam.process(frame).mask.empty();
    slam.finish();
    EXPECT_GT(masked, 10);
    EXPECT_EQ(leaked_points(slam), 0);
    EXPECT_TRUE(slam.statistics().detector_failed);
    EXPECT_EQ(asked, 3 + 10);
  }
  static std::vector<Event> warnings_of(Slam& slam) {
    std::vector<Event> warnings;
    for (Event& e : slam.take_events())
      if (e.kind == Event::Kind::warning) warnings.push_back(std::move(e));
    return warnings;
  }

  WallWorld world{320, 240};
  std::vector<Frame> people = world.walk(0, 30, kEnters);
};

TEST_F(LibraryDetectors, WithoutOneSomebodyGetsIntoTheMap) {
  Slam slam = slam_with(Detectors::none());
  run(slam, people);
  EXPECT_GT(leaked_points(slam), 20);
}

TEST_F(LibraryDetectors, APromptOneKeepsPeopleOut) {
  for (const Gives gives : kGives) {
    Slam slam = slam_with(prompt(gives));
    int on_mover = 0;
    for (const Frame& frame : people) {
      const FrameResult r = slam.process(frame);
      ASSERT_TRUE(r.tracked());
      for (const FeatureReport& f : r.features) on_mover += f.reason == FeatureReason::on_mover;
      if (r.frame == 20) {
        EXPECT_FALSE(r.mask.empty());
        EXPECT_EQ(r.detections.empty(), gives == Gives::masks);
      }
    }
    slam.finish();
    EXPECT_GT(on_mover, 100);
    EXPECT_EQ(leaked_points(slam), 0);
    EXPECT_EQ(slam.statistics().detector, "depth");
    EXPECT_TRUE(warnings_of(slam).empty());
  }
}

TEST_F(LibraryDetectors, OnesBoxesCountBesideAnothersMask) {
  Detectors both = prompt(Gives::boxes);
  both.prompt.push_back(std::make_shared<FunctionDetector>([](const DetectorInput& image) {
    Detections nobody;
    nobody.mask = GreyImage(image.depth.width, image.depth.height);
    return nobody;
  }));
  Slam slam = slam_with(std::move(both));
  run(slam, people);
  EXPECT_EQ(leaked_points(slam), 0);
}

TEST_F(LibraryDetectors, ASlowOnesMasksCountAsWellAsItsBoxes) {
  for (const Gives gives : kGives) {
    Slam slam = slam_with(slow(gives, {.every = 2, .latency = 2}));
    int masked = 0;
    for (const Frame& frame : people) masked += !slam.process(frame).mask.empty();
    slam.finish();
    EXPECT_GT(masked, 12) << static_cast<int>(gives);
    EXPECT_EQ(leaked_points(slam), 0) << static_cast<int>(gives);
    EXPECT_EQ(slam.statistics().detector_latency_frames, 2);
    EXPECT_NEAR(slam.statistics().detector_rate_hz, 15, 1);
  }
}

TEST_F(LibraryDetectors, WhereASlowOneFailsMotionGoesOn) {
  int asked = 0;
  Slam slam = slam_with(slow(failing_after_three(&asked), {.every = 1, .latency = 1}));
  expect_motion_goes_on(slam, asked);
  ASSERT_EQ(warnings_of(slam).size(), 2U) << "that it fails, and that it is given up";
}

TEST_F(LibraryDetectors, WhereAPromptOneFailsMotionGoesOn) {
  Detectors detectors = Detectors::none();
  int asked = 0;
  detectors.prompt.push_back(failing_after_three(&asked));
  Slam slam = slam_with(detectors);
  expect_motion_goes_on(slam, asked);
}

TEST_F(LibraryDetectors, WhatALateAnswerShowsIsRetracted) {
  for (const Gives gives : kGives) {
    // Somebody is in view for up to ten frames, and in keyframes, before the first answer that shows them.
    Options options;
    options.features.count = 1000;
    Slam slam = slam_with(slow(gives, {.every = 5, .latency = 6}), options);
    int leaked_once = 0;
    for (const Frame& frame : people) {
      slam.process(frame);
      leaked_once = std::max(leaked_once, leaked_points(slam));
    }
    slam.finish();
    EXPECT_GT(leaked_once, 0) << static_cast<int>(gives);
    EXPECT_GT(slam.statistics().points_retracted, 0) << static_cast<int>(gives);
    EXPECT_LE(leaked_points(slam), gives == Gives::boxes ? 0 : leaked_once / 4) << static_cast<int>(gives);
  }
}

TEST_F(LibraryDetectors, AreShownTheImagesOfTheFrame) {
  int asked = 0;
  Detectors detectors = Detectors::none();
  const auto look = std::make_shared<FunctionDetector>([&](const DetectorInput& image) {
    EXPECT_EQ(image.stamp_ns, people[static_cast<size_t>(asked)].stamp_ns());
    EXPECT_TRUE(image.colour.empty()) << "a grey camera";
    EXPECT_EQ(image.grey.format, PixelFormat::grey8);
    EXPECT_EQ(image.depth.format, PixelFormat::depth_f32);
    EXPECT_EQ(image.depth.width, 320);
    ++asked;
    return Detections();
  });
  detectors.prompt.push_back(look);
  Slam slam = slam_with(detectors);
  feed(slam, people);
  EXPECT_EQ(asked, 30);
}

TEST_F(LibraryDetectors, WhatAPromptOneThrowsIsToldOnceAndItIsAskedAgain) {
  for (const bool standard : {true, false}) {
    Detectors detectors = prompt(Gives::boxes);
    int calls = 0;
    detectors.prompt.push_back(std::make_shared<FunctionDetector>([&](const DetectorInput&) -> Detections {
      if (++calls % 3 == 0) {
        if (standard) throw std::runtime_error("cable loose");
        throw 42;
      }
      return {};
    }));
    Slam slam = slam_with(detectors);
    for (const Frame& frame : people) EXPECT_TRUE(slam.process(frame).tracked());
    slam.finish();
    EXPECT_EQ(calls, 30);
    const auto warnings = warnings_of(slam);
    ASSERT_EQ(warnings.size(), 1U);
    EXPECT_EQ(warnings[0].frame, 2);
    EXPECT_EQ(warnings[0].text, standard ? "detector function failed: cable loose"
                                         : "detector function failed: it threw something that is no exception");
    EXPECT_FALSE(slam.statistics().detector_failed);
    EXPECT_EQ(leaked_points(slam), 0) << "the other one works";
  }
}

TEST_F(LibraryDetectors, ASlowOneThatThrowsIsAWarningAndItsBoxesDoNotStay) {
  DepthDetector eyes(Gives::boxes);
  int calls = 0;
  bool mended = false;
  Slam slam = slam_with(slow(std::make_shared<FunctionDetector>([&](const DetectorInput& image) {
                               if (++calls >= 5 && !mended) throw std::runtime_error("out of memory");
                               return eyes.detect(image);
                             }),
                             {.every = 3, .latency = 2}));
  for (const Frame& frame : world.walk(0, 40, kEnters)) {
    const FrameResult r = slam.process(frame);
    EXPECT_TRUE(r.tracked()) << r.frame;
    if (r.frame == 12) {
      EXPECT_FALSE(r.detections.empty());
    }
    if (r.frame > 25) {
      EXPECT_TRUE(r.detections.empty()) << r.frame;
    }
  }
  slam.finish();
  EXPECT_EQ(calls, 14) << "frames 0, 3 ... 39";
  const auto warnings = warnings_of(slam);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].text, "the detector failed: out of memory");
  EXPECT_EQ(warnings[0].frame, 14) << "frame 12's answer, due two frames later";
  slam.reset();
  mended = true;
  slam.process(people[0]);
  slam.finish();
  EXPECT_EQ(calls, 15) << "it is asked again after a reset";
}

TEST_F(LibraryDetectors, ALiveRunGoesOnBesideOneThatHangs) {
  std::promise<void> hangs, let_go;
  int calls = 0;
  Options live;
  live.realtime = true;
  Slam slam = slam_with(slow(std::make_shared<FunctionDetector>([&](const DetectorInput&) {
                               if (++calls == 2) {
                                 hangs.set_value();
                                 let_go.get_future().wait();
                               }
                               return Detections();
                             }),
                             {.every = 1, .latency = 1}),
                        live);
  slam.process(people[0]);
  slam.process(people[1]);
  hangs.get_future().wait();
  for (size_t i = 2; i < people.size(); ++i) EXPECT_TRUE(slam.process(people[i]).tracked());
  let_go.set_value();
  slam.finish();
  EXPECT_EQ(slam.statistics().tracked, 30);
}

TEST_F(LibraryDetectors, NonsenseIsLeftOutWithAWarning) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Detections nonsense, sound;  // an answer of nothing but nonsense is a failure
  sound.boxes = {{"person", {20, 20, 8, 8}, 1}};
  nonsense.boxes = {
      {"ghost", {1e9f, 0, 10, 10}, 1}, sound.boxes[0], {"ghost", {nan, nan, nan, nan}, 1}, {"ghost", {9, 9, -3, 4}, 1}};
  nonsense.mask = GreyImage(7, 5, 255);
  for (const bool is_slow : {false, true}) {
    const auto with = [is_slow](const Detections& answer) {
      const auto detector = std::make_shared<FunctionDetector>([answer](const DetectorInput&) { return answer; });
      Detectors detectors = Detectors::none();
      if (is_slow)
        detectors.slow = detector;
      else
        detectors.prompt.push_back(detector);
      return detectors;
    };
    Slam slam = slam_with(with(nonsense)), other = slam_with(with(sound));
    run(slam, people);
    run(other, people);
    EXPECT_EQ(warnings_of(slam).size(), 1U) << "of one cause";
    EXPECT_EQ(bytes_of(slam), bytes_of(other)) << "it changed nothing";
  }
}

TEST_F(LibraryDetectors, ANullIsRefused) {
  Detectors detectors;
  detectors.prompt.push_back(nullptr);
  EXPECT_EQ(error_of([&] { slam_with(detectors); }), "detectors: one of `prompt` is null; leave it out");
}

TEST_F(LibraryDetectors, WhatADetectorThrowsIsToldInOneLine) {
  Detectors detectors = Detectors::none();
  detectors.prompt.push_back(std::make_shared<FunctionDetector>(
      [](const DetectorInput&) -> Detections { throw std::runtime_error("Traceback:\n  line 3\r\nno memory\n"); }));
  Slam slam = slam_with(detectors);
  slam.process(people[0]);
  const auto warnings = warnings_of(slam);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_EQ(warnings[0].text, "detector function failed: Traceback:  line 3 no memory");
}

TEST_F(LibraryDetectors, ThatTheyTakeAllFeaturesIsToldWhereTrackingCannotBegin) {
  Detectors detectors = Detectors::none();
  detectors.prompt.push_back(std::make_shared<FunctionDetector>([](const DetectorInput& image) {
    Detections everything;
    everything.mask = GreyImage(image.depth.width, image.depth.height, 255);
    return everything;
  }));
  Slam slam = slam_with(detectors);
  feed(slam, people);
  const auto warnings = warnings_of(slam);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].text.find("100% of them lie on what the detector (function) takes for movers"),
            std::string::npos)
      << warnings[0].text;
}

TEST_F(LibraryDetectors, FromWithinADetectorOrAKeyframeRuleNothingIsFed) {
  Slam* self = nullptr;
  Detectors detectors = Detectors::none();
  detectors.prompt.push_back(std::make_shared<FunctionDetector>([&](const DetectorInput&) {
    self->process(people[9]);
    return Detections();
  }));
  Slam slam = slam_with(detectors);
  self = &slam;
  EXPECT_TRUE(slam.process(people[0]).tracked());
  const auto warnings = warnings_of(slam);
  ASSERT_EQ(warnings.size(), 1U);
  EXPECT_NE(warnings[0].text.find("it is at work for another call"), std::string::npos) << warnings[0].text;

  const auto rule = std::make_shared<EveryNth>(3);
  Slam ruled(world.camera(), Options(), Detectors::none(), rule);
  feed(ruled, {people[0], people[1]});
  rule->throws = [&] { ruled.reset(); };
  EXPECT_NE(error_of([&] { ruled.process(people[2]); }).find("it is at work"), std::string::npos);
  rule->throws = nullptr;
  ruled.reset();
  EXPECT_TRUE(ruled.process(people[0]).tracked());
}

TEST_F(LibraryDetectors, AResetThatFailsIsAnErrorAndTheNextOneMayWork) {
  bool broken = true;
  const auto detector = std::make_shared<FunctionDetector>([](const DetectorInput&) { return Detections(); });
  detector->on_reset = [&] {
    if (broken) throw std::runtime_error("no such device");
  };
  EXPECT_NE(error_of([&] { slam_with(slow(detector)); }).find("no such device"), std::string::npos);
  broken = false;
  Slam slam = slam_with(slow(detector));
  feed(slam, {people[0], people[1]});
  broken = true;
  EXPECT_NE(error_of([&] { slam.reset(); }).find("no such device"), std::string::npos);
  EXPECT_NE(error_of([&] { slam.process(people[2]); }).find("no such device"), std::string::npos);
  EXPECT_NE(error_of([&] { slam.finish(); }).find("no such device"), std::string::npos);
  const fs::path file = fs::path(::testing::TempDir()) / ("dkb_no_world_" + std::to_string(::getpid()) + ".dkb");
  EXPECT_NE(error_of([&] { slam.save_map(file); }).find("no such device"), std::string::npos);
  EXPECT_FALSE(fs::exists(file)) << "an empty map may not take the place of the user's";
  slam.localize_only(false);
  slam.explain_keyframes(false);
  EXPECT_EQ(slam.map().point_count(), 0U);
  EXPECT_TRUE(slam.take_events().size() < 10);
  broken = false;
  slam.reset();
  EXPECT_TRUE(slam.process(people[0]).tracked());
}

// The faults that a network once had: silent for as many frames as were seen before, and boxes of the old world.
TEST_F(LibraryDetectors, AfterAResetAllIsAsInAFreshSystem) {
  int kind = 0;
  for (const auto& made : every_kind()) {
    Slam used = slam_with(made()), fresh = slam_with(made());
    feed(used, world.walk(3, 25, 5));
    used.reset();
    EXPECT_EQ(run(used, people), run(fresh, people)) << "kind " << kind;
    ++kind;
  }
}

TEST_F(LibraryDetectors, AfterALoadAllIsAsInAFreshSystem) {
  const fs::path file = fs::path(::testing::TempDir()) / ("dkb_detectors_" + std::to_string(::getpid()) + ".dkb");
  Slam mapper = slam_with(Detectors::none());
  run(mapper, world.walk(0, 8));
  mapper.save_map(file);
  int kind = 0;
  for (const auto& made : every_kind()) {
    Slam used = slam_with(made()), fresh = slam_with(made());
    feed(used, world.walk(3, 25, 5));
    used.load_map(file);
    fresh.load_map(file);
    EXPECT_EQ(run(used, people), run(fresh, people)) << "kind " << kind;
    EXPECT_GT(used.statistics().tracked, 20);
    ++kind;
  }
  fs::remove(file);
}

TEST_F(LibraryDetectors, AreAskedAndResetAnewInEveryWorld) {
  const auto detector = std::make_shared<DepthDetector>(Gives::boxes);
  Slam slam = slam_with(slow(detector, {.every = 5, .latency = 2}));
  EXPECT_EQ(detector->resets, 1);
  feed(slam, {people.begin(), people.begin() + 13});
  slam.reset();
  EXPECT_EQ(detector->resets, 2);
  detector->seen.clear();
  run(slam, {people.begin(), people.begin() + 8});  // the last one waits for the answer to the sixth
  EXPECT_EQ(detector->seen, (std::vector<int64_t>{people[0].stamp_ns(), people[5].stamp_ns()}));
}

TEST_F(LibraryDetectors, ThreadsDoNotChangeABit) {
  Options one_thread;
  one_thread.threaded = false;
  int kind = 0;
  for (const auto& made : every_kind()) {
    Slam with = slam_with(made()), without = slam_with(made(), one_thread);
    EXPECT_EQ(run(with, people), run(without, people)) << "kind " << kind;
    ++kind;
  }
}

TEST_F(LibraryDetectors, TwoSystemsInOneProcessDoNotKnowOfEachOther) {
  for (const auto& made : every_kind()) {
    Slam alone = slam_with(made()), first = slam_with(made()), second = slam_with(made());
    const std::string expected = feed(alone, people);
    std::string interleaved;
    for (size_t i = 0; i < people.size(); ++i) {
      interleaved += feed(first, {people[i]});
      if (i % 2 == 0) feed(second, {people[people.size() / 2 + i / 2]});
    }
    EXPECT_EQ(interleaved, expected);
    alone.finish();
    first.finish();
    EXPECT_EQ(bytes_of(alone), bytes_of(first));
  }
}

}  // namespace
}  // namespace dkb::test
