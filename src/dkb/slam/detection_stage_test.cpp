// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/detection_stage.h"

#include <gtest/gtest.h>

#include <future>
#include <limits>
#include <stdexcept>

#include "dkb/detection/detection.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Says which images it saw; throws from the frame `bad` on, for so many; waits for `gate` at the frame `slow`.
class ScriptedDetector final : public Detector {
 public:
  Detections detect(const DetectorInput& image) override {
    const int64_t frame = image.stamp_ns / 1'000'000'000;
    ++calls;
    if (frame == slow) {
      entered.set_value();
      gate.get_future().wait();
    }
    if (frame == never_started) throw NeverStarted("no such command");
    if (bad >= 0 && frame >= bad && frame < bad + bad_for) throw std::runtime_error("network fell over");
    Detections found;
    found.boxes.push_back({"person", {static_cast<float>(frame), static_cast<float>(calls), 1, 1}, 1});
    return found;
  }
  std::string kind() const override { return "scripted"; }

  int64_t bad = -1, bad_for = 1, never_started = -1, slow = -1;
  std::promise<void> gate, entered;
  int calls = 0;  // the stage's thread's, until the stage ends
};

// Gives the same answer for every image.
class FixedDetector final : public Detector {
 public:
  explicit FixedDetector(Detections answer) : answer_(std::move(answer)) {}
  Detections detect(const DetectorInput&) override { return answer_; }
  std::string kind() const override { return "fixed"; }

 private:
  Detections answer_;
};

// Frames are a second apart.
Frame frame_at(FrameIndex index) {
  auto image = std::make_shared<RgbdImage>();
  image->grey = GreyImage(4, 4);
  const int64_t stamp = int64_t{1'000'000'000} * index;
  return Frame(std::move(image), stamp, stamp);
}

struct Mode {
  bool threaded = true, realtime = false;
};

std::unique_ptr<DetectionStage> stage_of(Detector& detector, DetectionSchedule schedule, Mode mode = {}) {
  return std::make_unique<DetectionStage>(detector, Camera(), schedule, mode.threaded, mode.realtime);
}

std::vector<DueDetections> exchange(DetectionStage& stage, FrameIndex index, const Frame& frame) {
  stage.offer(index, frame);
  return stage.take_due(index);
}

// Everything that tracking would see of `frames` frames, as text, and how often the detector was asked.
std::string run(DetectionSchedule schedule, int64_t bad, FrameIndex frames, bool threaded = true) {
  ScriptedDetector detector;
  detector.bad = bad;
  std::string log;
  {
    const auto stage = stage_of(detector, schedule, {.threaded = threaded});
    for (FrameIndex frame = 0; frame < frames; ++frame) {
      log += std::to_string(frame);
      for (const DueDetections& due : exchange(*stage, frame, frame_at(frame))) {
        log += " <" + std::to_string(due.frame);
        for (const Detection& d : due.detections.boxes) log += "#" + std::to_string(static_cast<int>(d.box.y));
        EXPECT_EQ(due.stamp_ns, int64_t{1'000'000'000} * due.frame);
      }
      for (const std::string& warning : stage->take_warnings()) log += " !" + warning;
      log += ";";
    }
  }
  return log;
}

TEST(DetectionStage, ResultsComeAtTheirDueFrameAndTheFirstAtOnce) {
  EXPECT_EQ(run({.every = 2, .latency = 3}, -1, 9), "0 <0#1;1;2;3;4;5 <2#2;6;7 <4#3;8;");
}

TEST(DetectionStage, LatencyZeroServesEveryFrameAtOnce) {
  EXPECT_EQ(run({.every = 1, .latency = 0}, -1, 3), "0 <0#1;1 <1#2;2 <2#3;");
}

TEST(DetectionStage, OneThreadGivesTheSameBytes) {
  for (const int64_t bad : {-1, 0, 4, 6})
    for (const int every : {1, 2, 3})
      for (const int latency : {0, 1, 4, 7})
        EXPECT_EQ(run({.every = every, .latency = latency}, bad, 30),
                  run({.every = every, .latency = latency}, bad, 30, false));
}

TEST(DetectionStage, AFailureIsAnAnswerOfNothingAtItsDueFrameAndTheDetectorIsAskedAgain) {
  EXPECT_EQ(run({.every = 2, .latency = 3}, 4, 12),
            "0 <0#1;1;2;3;4;5 <2#2;6;7 <4 !the detector failed: network fell over;8;9 <6#4;10;11 <8#5;");
}

// Frames 2 ... 11 are ten.
TEST(DetectionStage, ADetectorThatFailsTenTimesInARowIsNotAskedAgain) {
  for (const bool threaded : {true, false}) {
    ScriptedDetector detector;
    detector.bad = 2, detector.bad_for = 100;
    std::vector<std::string> told;
    {
      const auto stage = stage_of(detector, {.every = 1, .latency = 4}, {.threaded = threaded});
      for (FrameIndex frame = 0; frame < 30; ++frame) {
        exchange(*stage, frame, frame_at(frame));
        EXPECT_EQ(stage->failing(), frame >= 2 + 4) << frame;
        EXPECT_EQ(stage->failed(), frame >= 11 + 4) << frame;
        for (std::string& warning : stage->take_warnings()) told.push_back(std::move(warning));
      }
    }
    EXPECT_EQ(detector.calls, 2 + 10);
    EXPECT_EQ(told, (std::vector<std::string>{
                        "the detector failed: network fell over",
                        "the detector failed 10 times in a row: network fell over; it is not asked again"}));
  }
}

TEST(DetectionStage, OneThatNeverStartedIsThrownWhereTheFirstAnswerIsWaitedFor) {
  for (const bool threaded : {true, false})
    for (const bool realtime : {true, false}) {
      ScriptedDetector first, second;
      first.never_started = 0, second.never_started = 1;
      const auto refused = stage_of(first, {.every = 1, .latency = 0}, {threaded, realtime});
      EXPECT_THROW(exchange(*refused, 0, frame_at(0)), NeverStarted);
      if (realtime) continue;  // later answers come when they come
      const auto survived = stage_of(second, {.every = 1, .latency = 0}, {threaded, realtime});
      for (const FrameIndex frame : {0, 1}) exchange(*survived, frame, frame_at(frame));
      EXPECT_TRUE(survived->failed());
      EXPECT_EQ(survived->take_warnings().size(), 1U);
    }
}

TEST(DetectorFailures, AnAnswerBetweenThemEndsTheRow) {
  DetectorFailures failures;
  for (int i = 0; i < 9; ++i) failures.failed("dark");
  EXPECT_TRUE(failures.failing());
  failures.answered("");
  EXPECT_FALSE(failures.failing());
  for (int i = 0; i < 9; ++i) failures.failed("dark");
  EXPECT_FALSE(failures.given_up());
  failures.failed("dark");
  EXPECT_TRUE(failures.given_up());
}

TEST(DetectorFailures, OneThatHasEndedIsGivenUpAtOnce) {
  DetectorFailures failures;
  EXPECT_EQ(failures.ended("it ended"), " failed: it ended; it is not asked again");
  EXPECT_TRUE(failures.given_up());
}

TEST(DetectorFailures, EachCauseIsToldOnceInARow) {
  DetectorFailures failures;
  EXPECT_EQ(failures.failed("dark"), " failed: dark");
  EXPECT_EQ(failures.failed("dark"), "");
  EXPECT_EQ(failures.failed("bright"), " failed: bright");
  EXPECT_EQ(failures.answered("a box lies outside the image; it is left out"),
            ": a box lies outside the image; it is left out");
  EXPECT_EQ(failures.answered("a box lies outside the image; it is left out"), "");
}

TEST(DetectionStage, FramesThatWereSkippedDoNotStopTheRhythm) {
  ScriptedDetector detector;
  const auto stage = stage_of(detector, {.every = 3, .latency = 1}, {.threaded = false});
  const auto asked_at = [&](FrameIndex frame) {
    const int before = detector.calls;
    exchange(*stage, frame, frame_at(frame));
    return detector.calls > before;
  };
  EXPECT_TRUE(asked_at(5));
  EXPECT_FALSE(asked_at(7));
  EXPECT_TRUE(asked_at(9)) << "8 was skipped";
  EXPECT_FALSE(asked_at(11));
  EXPECT_TRUE(asked_at(12));
}

TEST(DetectionStage, ADetectorThatIsToRestDoesSoAsLongAsItsAnswerTook) {
  ScriptedDetector detector;
  const auto stage = stage_of(detector, {.every = 1, .latency = 2}, {.threaded = false, .realtime = true});
  std::vector<FrameIndex> asked;
  for (FrameIndex frame = 0; frame < 40; ++frame) {
    stage->rest(frame >= 10);
    const int before = detector.calls;
    exchange(*stage, frame, frame_at(frame));
    if (detector.calls > before) asked.push_back(frame);
  }
  const std::vector<FrameIndex> expected{0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 13, 17, 21, 25, 29, 33, 37};
  EXPECT_EQ(asked, expected);
}

TEST(DetectionStage, RealtimeNeverWaitsForOneThatHangsAndDropsWhatPilesUp) {
  ScriptedDetector detector;
  detector.slow = 1;
  const auto stage = stage_of(detector, {.every = 1, .latency = 1}, {.realtime = true});
  EXPECT_EQ(exchange(*stage, 0, frame_at(0)).size(), 1u) << "the first is waited for";
  EXPECT_TRUE(exchange(*stage, 1, frame_at(1)).empty());
  detector.entered.get_future().wait();
  for (FrameIndex frame = 2; frame < 6; ++frame) EXPECT_TRUE(exchange(*stage, frame, frame_at(frame)).empty());
  detector.gate.set_value();
  std::vector<DueDetections> due;
  for (FrameIndex frame = 6; due.size() < 2; ++frame)
    for (DueDetections& d : exchange(*stage, frame, frame_at(frame))) due.push_back(std::move(d));
  EXPECT_EQ(due[0].frame, 1);
  EXPECT_GE(due[1].frame, 5) << "2, 3 and 4 gave way to it";
}

TEST(DetectionStage, EndsWithTheWorkInHandAndDropsTheRest) {
  ScriptedDetector detector;
  detector.slow = 1;
  auto stage = stage_of(detector, {.every = 1, .latency = 5});
  for (FrameIndex frame = 0; frame < 4; ++frame) exchange(*stage, frame, frame_at(frame));
  detector.entered.get_future().wait();
  detector.gate.set_value();
  stage.reset();
  EXPECT_GE(detector.calls, 2);
}

TEST(DetectionStage, OnlyWhatCountsAtOnceMustBeOfferedBeforeItIsTaken) {
  ScriptedDetector detector, another;  // one each: a stage asks its own on its own thread
  const auto late = stage_of(detector, {.every = 1, .latency = 1});
  EXPECT_TRUE(late->answers_at_once()) << "the first answer counts at its own frame";
  late->offer(0, frame_at(0));
  EXPECT_EQ(late->take_due(0).size(), 1u);
  EXPECT_FALSE(late->answers_at_once());
  late->offer(0, frame_at(0));
  for (FrameIndex frame = 1; frame < 4; ++frame) {
    const auto due = late->take_due(frame);
    ASSERT_EQ(due.size(), frame > 1 ? 1u : 0u);
    if (!due.empty()) {
      EXPECT_EQ(due[0].frame, frame - 1);
    }
    late->offer(frame, frame_at(frame));
  }
  const auto prompt = stage_of(another, {.every = 1, .latency = 0});
  prompt->offer(0, frame_at(0));
  EXPECT_TRUE(prompt->answers_at_once());
}

TEST(DetectionStage, TellsRateAndCost) {
  ScriptedDetector detector;
  const auto stage = stage_of(detector, {.every = 2, .latency = 2});
  for (FrameIndex frame = 0; frame < 9; ++frame) exchange(*stage, frame, frame_at(frame));
  EXPECT_DOUBLE_EQ(stage->rate_hz(), 0.5) << "stamps a second apart";
  EXPECT_EQ(stage->take_times().summaries().at("detection").count, 4u) << "of frames 0, 2, 4, 6";
  EXPECT_TRUE(stage->take_times().summaries().empty()) << "they were taken";
}

TEST(DetectionStage, WhatDoesNotFitTheImageIsLeftOutWithAWarning) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
  Detections answer;
  answer.boxes = {{"whole", {10, 20, 30, 40}, 0.5f},  {"beside", {700, 20, 30, 40}, 1},
                  {"over", {600, 460, 90, 90}, 1},    {"nowhere", {nan, 20, 30, 40}, 1},
                  {"flat", {10, 20, 0, 40}, 1},       {"endless", {0, 0, infinity, 9}, 1},
                  {"inside out", {50, 50, -9, 9}, 1}, {"left", {-40, 10, 40, 10}, 1}};
  answer.mask = GreyImage(320, 240, 255);
  FixedDetector detector(answer);
  const auto stage = stage_of(detector, {.every = 1, .latency = 0});
  const auto due = exchange(*stage, 0, frame_at(0));
  ASSERT_EQ(due.size(), 1u);
  EXPECT_EQ(due[0].detections.boxes,
            (std::vector<Detection>{{"whole", {10, 20, 30, 40}, 0.5f}, {"over", {600, 460, 40, 20}, 1}}));
  EXPECT_TRUE(due[0].detections.mask.empty());
  const auto warnings = stage->take_warnings();
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings[0],
            "the detector: a mask is of 320 x 240 px, the images of 640 x 480; scale it to the image; it is left out");
  EXPECT_FALSE(stage->failing());
}

// Else it would count as "nobody is there", and people would get into the map.
TEST(DetectionStage, AnAnswerOfWhichNothingFitsIsAFailure) {
  Detections mask, boxes;
  mask.mask = GreyImage(320, 240, 255);
  boxes.boxes = {{"person", {700, 20, 30, 40}, 1}, {"person", {20, 500, 30, 40}, 1}};
  for (const auto& [answer, cause] :
       {std::pair{mask, "a mask is of 320 x 240 px, the images of 640 x 480; scale it to the image"},
        std::pair{boxes, "a box lies outside the image; give left, top, width and height in pixels of the image"}}) {
    FixedDetector detector(answer);
    const auto stage = stage_of(detector, {.every = 1, .latency = 0}, {.threaded = false});
    for (FrameIndex frame = 0; frame < 9; ++frame) exchange(*stage, frame, frame_at(frame));
    EXPECT_TRUE(stage->failing());
    EXPECT_FALSE(stage->failed());
    exchange(*stage, 9, frame_at(9));
    EXPECT_TRUE(stage->failed());
    const auto warnings = stage->take_warnings();
    ASSERT_EQ(warnings.size(), 2u);
    EXPECT_EQ(warnings[0], std::string("the detector failed: ") + cause);
    EXPECT_EQ(warnings[1], std::string("the detector failed 10 times in a row: ") + cause + "; it is not asked again");
  }
}

TEST(DetectionStage, NobodyThereIsAnAnswer) {
  FixedDetector detector({});
  const auto stage = stage_of(detector, {.every = 1, .latency = 0}, {.threaded = false});
  exchange(*stage, 0, frame_at(0));
  EXPECT_FALSE(stage->failing());
  EXPECT_TRUE(stage->take_warnings().empty());
}

TEST(MakeFit, SaysNothingOfWhatFits) {
  Detections found;
  found.boxes = {{"person", {0, 0, 640, 480}, 1}, {"dog", {600, 400, 100, 100}, 1}};
  found.mask = GreyImage(640, 480);
  EXPECT_EQ(make_fit(found, 640, 480).what, "");
  EXPECT_EQ(found.boxes.size(), 2u);
  EXPECT_FALSE(found.mask.empty());
  found.boxes.push_back({"ghost", {0, -10, 5, 10}, 1});
  const Misfit misfit = make_fit(found, 640, 480);
  EXPECT_EQ(misfit.what, "a box lies outside the image; give left, top, width and height in pixels of the image");
  EXPECT_FALSE(misfit.nothing_left);
  EXPECT_EQ(found.boxes.size(), 2u);
}

TEST(DetectionSchedule, IsChecked) {
  EXPECT_THROW(DetectionSchedule{.every = 0}.check(), InvalidOption);
  EXPECT_THROW(DetectionSchedule{.latency = -1}.check(), InvalidOption);
  EXPECT_NO_THROW((DetectionSchedule{.every = 1, .latency = 0}.check()));
}

}  // namespace
}  // namespace dkb
