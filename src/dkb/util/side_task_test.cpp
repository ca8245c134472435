// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/side_task.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

TEST(SideTask, DoesItsWorkOncePerRoundOnWhicheverThread) {
  for (const bool threaded : {true, false}) {
    int given = 0, sum = 0;
    SideTask task(
        "adding", [&] { sum += given; }, threaded);
    for (int i = 1; i <= 5000; ++i) {
      given = i;
      task.begin();
      task.finish();
    }
    EXPECT_EQ(sum, 5000 * 5001 / 2);
  }
}

TEST(SideTask, HasNothingToFinishBeforeItIsBegun) {
  int times = 0;
  SideTask task(
      "counting", [&] { ++times; }, true);
  task.finish();
  EXPECT_EQ(times, 0);
  task.begin();
  task.finish();
  task.finish();
  EXPECT_EQ(times, 1);
}

// Counts, or fails while it is told to.
struct Counting {
  explicit Counting(bool threaded)
      : task(
            "counting", [this] { count(); }, threaded) {}
  void count() {
    if (fails) throw std::runtime_error("no fingers");
    ++times;
  }
  bool fails = true;
  int times = 0;
  SideTask task;  // last: its thread ends first
};

TEST(SideTask, ThrowsAtTheEndWhatTheWorkThrewAndGoesOn) {
  for (const bool threaded : {true, false}) {
    Counting counting(threaded);
    counting.task.begin();
    EXPECT_EQ(test::input_error_of([&] { counting.task.finish(); }), "counting failed: no fingers");
    counting.fails = false;
    counting.task.begin();
    counting.task.finish();
    EXPECT_EQ(counting.times, 1);
  }
}

TEST(SideTask, ARoundThatNobodyFinishedIsNoPartOfTheNext) {
  for (const bool threaded : {true, false})
    for (int i = 0; i < 200; ++i) {
      Counting counting(threaded);
      counting.task.begin();
      counting.task.drop();
      counting.fails = false;
      counting.task.begin();
      counting.task.finish();
      EXPECT_EQ(counting.times, 1);
    }
}

TEST(SideTask, MayBeDestroyedWhileAtWork) {
  for (int i = 0; i < 200; ++i) {
    int times = 0;
    {
      SideTask task(
          "counting", [&] { ++times; }, true);
      task.begin();
    }
    EXPECT_LE(times, 1);
  }
}

}  // namespace
}  // namespace dkb
