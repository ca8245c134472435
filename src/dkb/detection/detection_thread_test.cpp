// SPDX-License-Identifier: Apache-2.0
#include "dkb/detection/detection_thread.h"

#include <gtest/gtest.h>

#include <future>
#include <stdexcept>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

// Says which images it saw; throws at the stamp `bad`; waits for `gate` at the stamp `slow`.
class ScriptedDetector final : public Detector {
 public:
  Detections detect(const RgbdImage& image) override {
    if (image.timestamp == slow) {
      entered.set_value();
      gate.get_future().wait();
    }
    if (image.timestamp == bad) throw std::runtime_error("network fell over");
    Detections found;
    found.timestamp = image.timestamp;
    found.boxes.push_back({"person", {static_cast<float>(image.timestamp), static_cast<float>(++calls), 1, 1}, 1});
    return found;
  }
  std::string kind() const override { return "scripted"; }

  double bad = -1, slow = -1;
  std::promise<void> gate, entered;
  int calls = 0;
};

std::shared_ptr<const RgbdImage> image_at(int64_t frame) {
  RgbdImage image;
  image.timestamp = static_cast<double>(frame);
  return std::make_shared<const RgbdImage>(std::move(image));
}

// Everything that tracking would see of `frames` frames, as text.
std::string run(DetectionSchedule schedule, double bad, int64_t frames) {
  auto detector = std::make_unique<ScriptedDetector>();
  detector->bad = bad;
  DetectionThread stage(std::move(detector), schedule);
  std::string log;
  for (int64_t frame = 0; frame < frames; ++frame) {
    log += std::to_string(frame) + (stage.push(frame, image_at(frame)) ? "+" : "");
    for (const DueDetections& due : stage.take_due(frame))
      log += " <" + std::to_string(due.frame) + "#" + std::to_string(static_cast<int>(due.detections.boxes[0].box.y));
    if (const auto error = stage.take_error()) log += " !" + *error;
    log += stage.failed() ? "x;" : ";";
  }
  return log;
}

TEST(DetectionThread, ResultsComeAtTheirDueFrameAndTheFirstAtOnce) {
  EXPECT_EQ(run({.every = 2, .latency = 3}, -1, 9), "0+ <0#1;1;2+;3;4+;5 <2#2;6+;7 <4#3;8+;");
}

TEST(DetectionThread, LatencyZeroServesEveryFrameAtOnce) {
  EXPECT_EQ(run({.every = 1, .latency = 0}, -1, 3), "0+ <0#1;1+ <1#2;2+ <2#3;");
}

TEST(DetectionThread, OneThreadGivesTheSameBytes) {
  for (const double bad : {-1.0, 0.0, 4.0, 6.0})
    for (const int every : {1, 2, 3})
      for (const int latency : {0, 1, 4, 7})
        EXPECT_EQ(run({.every = every, .latency = latency, .threaded = true}, bad, 30),
                  run({.every = every, .latency = latency, .threaded = false}, bad, 30));
}

TEST(DetectionThread, AFailureIsHandedOverOnceAtItsDueFrame) {
  EXPECT_EQ(run({.every = 2, .latency = 3}, 4, 10), "0+ <0#1;1;2+;3;4+;5 <2#2;6+;7 !network fell overx;8x;9x;");
}

TEST(DetectionThread, FramesThatWereSkippedDoNotStopTheRhythm) {
  DetectionThread stage(std::make_unique<ScriptedDetector>(), {.every = 3, .latency = 1, .threaded = false});
  EXPECT_TRUE(stage.push(5, image_at(5)));
  EXPECT_FALSE(stage.push(7, image_at(7)));
  EXPECT_TRUE(stage.push(9, image_at(9)));  // 8 was skipped
  EXPECT_FALSE(stage.push(11, image_at(11)));
  EXPECT_TRUE(stage.push(12, image_at(12)));
}

TEST(DetectionThread, RealtimeNeverWaitsAndDropsWhatPilesUp) {
  auto owned = std::make_unique<ScriptedDetector>();
  ScriptedDetector& detector = *owned;
  detector.slow = 1;
  DetectionThread stage(std::move(owned), {.every = 1, .latency = 1, .realtime = true});
  stage.push(0, image_at(0));
  EXPECT_EQ(stage.take_due(0).size(), 1u);  // the first is waited for
  stage.push(1, image_at(1));
  detector.entered.get_future().wait();
  for (int64_t frame = 2; frame < 6; ++frame) {
    EXPECT_TRUE(stage.push(frame, image_at(frame)));
    EXPECT_TRUE(stage.take_due(frame).empty());
  }
  EXPECT_EQ(stage.stats().dropped, 3u);  // 2, 3 and 4 gave way to 5
  detector.gate.set_value();
  std::vector<DueDetections> due;
  while (due.size() < 2)
    for (DueDetections& d : stage.take_due(6)) due.push_back(std::move(d));
  EXPECT_EQ(due[0].frame, 1);
  EXPECT_EQ(due[1].frame, 5);
  EXPECT_GE(stage.stats().late, 1u);
}

TEST(DetectionThread, StoppingLetsTheWorkInHandEndAndDropsTheRest) {
  auto owned = std::make_unique<ScriptedDetector>();
  ScriptedDetector& detector = *owned;
  detector.slow = 3;
  DetectionThread stage(std::move(owned), {.every = 1, .latency = 5});
  stage.push(3, image_at(3));
  stage.push(4, image_at(4));
  detector.entered.get_future().wait();
  detector.gate.set_value();
  stage.stop();
  EXPECT_FALSE(stage.push(9, image_at(9)));
  EXPECT_LE(stage.take_due(20).size(), 2u);
  stage.stop();  // again: nothing happens
}

TEST(DetectionThread, StatsTellKindRateLatencyAndCost) {
  DetectionThread stage(std::make_unique<ScriptedDetector>(), {.every = 2, .latency = 2});
  for (int64_t frame = 0; frame < 9; ++frame) {
    stage.push(frame, image_at(frame));
    stage.take_due(frame);
  }
  stage.stop();
  const DetectionStats stats = stage.stats();
  EXPECT_EQ(stats.kind, "scripted");
  EXPECT_EQ(stats.latency_frames, 2);
  EXPECT_EQ(stats.results, 4u);          // of frames 0, 2, 4, 6
  EXPECT_DOUBLE_EQ(stats.rate_hz, 0.5);  // stamps a second apart
  EXPECT_GE(stage.times().summaries().at("detection").count, 4u);
}

TEST(DetectionSchedule, IsChecked) {
  EXPECT_THROW(DetectionSchedule{.every = 0}.check(), InvalidOption);
  EXPECT_THROW(DetectionSchedule{.latency = -1}.check(), InvalidOption);
}

}  // namespace
}  // namespace dkb
