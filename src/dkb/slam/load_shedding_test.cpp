// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/load_shedding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace dkb {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kPeriod = 33 * kMs;

// A camera whose frames wait in a queue, and a thread that works at them.
class Queue {
 public:
  explicit Queue(LoadShedding& load) : load_(load) {}

  // A frame that takes `ms`; returns the level at which it is worked.
  LoadShedding::Level work(int64_t ms) {
    now_ = std::max(now_, stamp_);
    load_.begin(stamp_, now_);
    now_ += ms * kMs;
    load_.end(now_);
    stamp_ += kPeriod;
    return load_.level();
  }
  std::vector<LoadShedding::Level> work(int frames, int64_t ms) {
    std::vector<LoadShedding::Level> levels;
    for (int i = 0; i < frames; ++i) {
      const auto level = work(ms);
      if (levels.empty() || levels.back() != level) levels.push_back(level);
    }
    return levels;
  }
  void wait(int64_t ms) { now_ += ms * kMs; }
  double late_s() const { return 1e-9 * static_cast<double>(std::max(now_, stamp_) - stamp_); }

 private:
  LoadShedding& load_;
  int64_t stamp_ = 0, now_ = 0;
};

using Levels = std::vector<LoadShedding::Level>;

TEST(LoadShedding, WhoKeepsUpLeavesNothingOut) {
  LoadShedding load;
  Queue queue(load);
  EXPECT_EQ(queue.work(300, 32), Levels{LoadShedding::kFull});
  EXPECT_EQ(load.take_warning(), "");
  for (const auto& [name, seconds] : load.seconds_by_name()) EXPECT_EQ(seconds, 0) << name;
}

// Frames that are slow by turns: what matters is how late the queue is by all of them.
TEST(LoadShedding, SlowFramesCountByWhatTheFastOnesDoNotMakeUpFor) {
  const auto level_after = [](int64_t fast_ms) {
    LoadShedding load;
    Queue queue(load);
    for (int i = 0; i < 60; ++i) queue.work(1, i % 2 == 0 ? 60 : fast_ms);
    return load.level();
  };
  EXPECT_EQ(level_after(6), LoadShedding::kFull);
  EXPECT_NE(level_after(20), LoadShedding::kFull);
}

TEST(LoadShedding, TheStepsComeInTheStatedOrderBeforeAnyFrameOfAFullQueueIsLost) {
  LoadShedding load;
  Queue queue(load);
  const Levels all{LoadShedding::kFull, LoadShedding::kDetection, LoadShedding::kLoops, LoadShedding::kFeatures};
  EXPECT_EQ(queue.work(25, 2 * 33), all);
  EXPECT_LT(queue.late_s(), 1.0);
}

TEST(LoadShedding, OneSlowFrameIsNoReason) {
  LoadShedding load;
  Queue queue(load);
  queue.work(10, 20);
  EXPECT_EQ(queue.work(1, 4 * 33), Levels{LoadShedding::kFull});
  EXPECT_EQ(queue.work(50, 20), Levels{LoadShedding::kFull});
}

TEST(LoadShedding, WhoCatchesUpLeavesNothingOut) {
  LoadShedding load;
  Queue queue(load);
  EXPECT_EQ(queue.work(1, 20 * 33), Levels{LoadShedding::kFull}) << "as while a detector is loaded";
  EXPECT_EQ(queue.work(100, 25), Levels{LoadShedding::kFull});
}

TEST(LoadShedding, StepsAreTakenBackInTurnOnceNothingIsLate) {
  LoadShedding load;
  Queue queue(load);
  queue.work(30, 60);
  ASSERT_EQ(load.level(), LoadShedding::kFeatures);
  const Levels back{LoadShedding::kFeatures, LoadShedding::kLoops, LoadShedding::kDetection, LoadShedding::kFull};
  EXPECT_EQ(queue.work(400, 20), back);
}

TEST(LoadShedding, TellsOnceAndForHowLong) {
  LoadShedding load;
  Queue queue(load);
  queue.work(30, 60);
  EXPECT_NE(load.take_warning(), "");
  queue.work(400, 20);
  queue.work(30, 60);
  EXPECT_EQ(load.take_warning(), "");
  const auto seconds = load.seconds_by_name();
  EXPECT_GT(seconds.at("features"), 1);
  EXPECT_GT(seconds.at("loop_search"), seconds.at("features") + 2);
  EXPECT_GT(seconds.at("detection"), seconds.at("loop_search") + 2);
  EXPECT_LT(seconds.at("detection"), 460 * 0.033);
}

// As when a visitor of the page holds a recording, whose clock then stands still.
TEST(LoadShedding, APauseBetweenTwoFramesIsNotLate) {
  LoadShedding load;
  Queue queue(load);
  queue.work(10, 20);
  queue.wait(10'000);
  queue.work(20);
  EXPECT_EQ(load.level(), LoadShedding::kFull);
}

}  // namespace
}  // namespace dkb
