// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/due_stage.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>

#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

using Squares = DueStage<int, int>;

int square(const int& x) {
  return x * x;
}

TEST(DueStage, ResultsComeInOrderAtTheirDueTimesAndNotBefore) {
  for (const bool threaded : {false, true}) {
    Squares stage(square, {.name = "squares", .threaded = threaded});
    stage.push(3, 10);
    stage.push(4, 10);
    stage.push(5, 12);
    EXPECT_FALSE(stage.take_due(9, true));
    EXPECT_EQ(stage.take_due(10, true), 9);
    EXPECT_EQ(stage.take_due(10, true), 16);
    EXPECT_FALSE(stage.take_due(11, true));
    EXPECT_EQ(stage.outstanding(), 1U);
    EXPECT_EQ(stage.take_due(40, true), 25);
    EXPECT_EQ(stage.outstanding(), 0U);
  }
}

TEST(DueStage, WhatWaitsForItsDueFrameIsNoWorkLeft) {
  Squares stage(square, {.name = "squares", .threaded = false});
  stage.push(3, 10);
  EXPECT_EQ(stage.outstanding(), 1U);
  EXPECT_EQ(stage.unfinished(), 0U);

  std::promise<void> begun, go_on;
  DueStage<int, int> busy(
      [&](const int& x) {
        if (x == 0) begun.set_value(), go_on.get_future().wait();
        return x;
      },
      {.name = "waiting", .threaded = true});
  busy.push(0, 10);
  busy.push(1, 10);
  begun.get_future().wait();
  EXPECT_EQ(busy.unfinished(), 2U);
  go_on.set_value();
  EXPECT_EQ(busy.take_due(10, true), 0);
  EXPECT_EQ(busy.take_due(10, true), 1);
  EXPECT_EQ(busy.unfinished(), 0U);
}

// What a caller sees of a hundred frames, failures among them.
std::string log_of(bool threaded) {
  DueStage<int, int> stage(
      [](const int& x) {
        if (x % 7 == 3) throw std::runtime_error("no " + std::to_string(x));
        return 2 * x;
      },
      {.name = "doubling", .threaded = threaded});
  std::string log;
  for (int frame = 0; frame < 100; ++frame) {
    log += std::to_string(frame) + ":";
    try {
      while (const auto result = stage.take_due(frame, true)) log += " " + std::to_string(*result);
    } catch (const InputError& e) {
      log += std::string(" ") + e.what();
    }
    log += " (" + std::to_string(stage.outstanding()) + ")";
    if (frame % 3 == 0) stage.push(frame, frame + 4);
    if (frame % 9 == 0) stage.push(-frame, frame + 4);
  }
  return log;
}

TEST(DueStage, AThreadChangesNothingThatTheCallerSees) {
  const std::string without = log_of(false);
  EXPECT_NE(without.find("7: doubling failed: no 3 (1)"), std::string::npos) << without;
  for (int n = 0; n < 20; ++n) ASSERT_EQ(log_of(true), without);
}

TEST(DueStage, FailuresAreThrownAtTheirDueFrameAndNameTheStage) {
  for (const bool threaded : {false, true}) {
    DueStage<int, int> stage(
        [](const int& x) -> int {
          if (x == 1) throw std::out_of_range("it slipped");
          if (x == 2) throw InputError("map.dkb: is broken");
          if (x == 3) throw 42;
          return x;
        },
        {.name = "mapping", .threaded = threaded});
    for (int x = 0; x < 5; ++x) stage.push(x, 10 + x);
    EXPECT_EQ(stage.take_due(10, true), 0);
    EXPECT_EQ(test::input_error_of([&] { stage.take_due(10, true); }), "no error") << "not before it is due";
    EXPECT_EQ(test::input_error_of([&] { stage.take_due(20, true); }), "mapping failed: it slipped");
    EXPECT_EQ(test::input_error_of([&] { stage.take_due(20, true); }), "map.dkb: is broken");
    EXPECT_EQ(test::input_error_of([&] { stage.take_due(20, true); }),
              "mapping failed: it threw something that is no exception");
    EXPECT_EQ(stage.take_due(20, true), 4) << "later tasks are worked at all the same";
    EXPECT_EQ(stage.outstanding(), 0U);
  }
}

TEST(DueStage, NoResultIsDueBeforeThatOfTheTaskPushedBefore) {
  Squares stage(square, {.name = "squares"});
  stage.push(3, 10);
  stage.push(4, 9);
  EXPECT_EQ(stage.take_due(9, true), std::nullopt);
  EXPECT_EQ(stage.take_due(10, true), 9);
  EXPECT_EQ(stage.take_due(10, true), 16);
  stage.push(5, 9);
  EXPECT_EQ(stage.take_due(9, true), std::nullopt) << "also when nothing is outstanding";
  EXPECT_EQ(stage.take_due(10, true), 25);
}

// A stage whose work waits until it is let go.
struct Gated {
  std::promise<void> entered, gate;
  std::atomic<int> worked{0};
  Squares stage;

  Gated()
      : stage(
            [this](const int& x) {
              if (x == 0) {
                entered.set_value();
                gate.get_future().wait();
              }
              ++worked;
              return x * x;
            },
            {.name = "gated"}) {}
};

TEST(DueStage, WhoDoesNotWaitTakesOnlyWhatIsReady) {
  Gated g;
  g.stage.push(0, 1);
  g.entered.get_future().wait();
  EXPECT_TRUE(g.stage.must_wait(1));
  EXPECT_FALSE(g.stage.must_wait(0));
  EXPECT_FALSE(g.stage.take_due(1, false));
  EXPECT_EQ(g.stage.outstanding(), 1U);
  g.gate.set_value();
  EXPECT_EQ(g.stage.take_due(1, true), 0);
  EXPECT_FALSE(g.stage.must_wait(9));
}

TEST(DueStage, PatienceEnds) {
  Gated g;
  g.stage.push(0, 5);
  g.entered.get_future().wait();
  EXPECT_FALSE(g.stage.take_due_within(4, 60)) << "what is not due is not waited for";
  EXPECT_FALSE(g.stage.take_due_within(5, 0.01));
  g.gate.set_value();
  EXPECT_EQ(g.stage.take_due_within(5, 60), 0);
}

TEST(DueStage, DropsWhatNobodyHasBegun) {
  Gated g;
  g.stage.push(0, 1);
  g.entered.get_future().wait();
  g.stage.push(2, 2);
  g.stage.push(3, 3);
  g.stage.drop_waiting();
  EXPECT_EQ(g.stage.outstanding(), 1U);
  g.stage.push(4, 4);
  g.gate.set_value();
  EXPECT_EQ(g.stage.take_due(9, true), 0);
  EXPECT_EQ(g.stage.take_due(9, true), 16);
  EXPECT_FALSE(g.stage.take_due(9, true));
}

TEST(DueStage, EndsTheWorkInHandAndDropsTheRest) {
  auto g = std::make_unique<Gated>();
  std::atomic<int>& worked = g->worked;
  g->stage.push(0, 1);
  for (int x = 1; x < 10; ++x) g->stage.push(x, 1 + x);
  g->entered.get_future().wait();
  EXPECT_EQ(worked, 0);
  g->gate.set_value();
  EXPECT_NO_THROW(g.reset());
}

TEST(DueStage, StartsAndStopsAtAnyTime) {
  std::atomic<int> worked{0};
  for (int n = 0; n < 300; ++n) {
    DueStage<int, int> stage([&](const int& x) { return worked += x; }, {.name = "counting"});
    for (int x = 0; x < n % 4; ++x) stage.push(1, x);
    if (n % 3 == 0) stage.take_due(0, n % 2 == 0);
  }
  EXPECT_LE(worked, 450);
}

}  // namespace
}  // namespace dkb
