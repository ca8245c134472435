// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/stamp_doubt.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

// What is told of 60 frames so many nanoseconds apart, and at which one.
std::string told(double rate, int64_t interval_ns) {
  StampDoubt doubt(rate);
  std::string all;
  for (int i = 0; i < 60; ++i)
    if (const std::string text = doubt.add(i * interval_ns); !text.empty()) all += std::to_string(i) + ": " + text;
  return all;
}

TEST(StampDoubt, ToldOnceOfStampsInAnotherUnit) {
  EXPECT_EQ(told(30, 33'333),
            "30: the stamps of the first frames are 3.3e-05 s apart in the median, and the camera gives 30 frames a "
            "second; stamps must be in nanoseconds, those of a folder's lists in seconds");
  EXPECT_NE(told(30, 33), "") << "milliseconds";
  EXPECT_NE(told(30, 33'333'333'000), "") << "a thousand too many";
  EXPECT_NE(told(0, 33'333).find("cameras give about 30"), std::string::npos);
}

TEST(StampDoubt, NothingIsToldOfAnyRateThatACameraMayRunAt) {
  for (const double rate : {0.0, 30.0, 90.0})
    for (const int64_t ms : {5, 16, 33, 100, 1000}) EXPECT_EQ(told(rate, ms * 1'000'000), "") << rate << ", " << ms;
}

// Frames whose stamps come before it are refused from then on.
TEST(StampDoubt, OneGapIsToldAsALeapNotAsAUnit) {
  for (const double rate : {0.0, 30.0})
    for (const int at : {10, 50}) {
      StampDoubt doubt(rate);
      for (int i = 0; i < 60; ++i)
        EXPECT_EQ(doubt.add(i * int64_t{33'333'333} + (i < at ? 0 : 10'000'000'000)),
                  i == at ? "the stamp is 10 s after the one before it; if the clock leapt, call reset(): frames with "
                            "earlier stamps are refused"
                          : "");
    }
}

TEST(StampDoubt, AGapOfThreeSecondsIsUsual) {
  StampDoubt doubt(30);
  for (int i = 0; i < 60; ++i) EXPECT_EQ(doubt.add(i * int64_t{33'333'333} + (i < 40 ? 0 : 3'000'000'000)), "");
}

TEST(StampDoubt, APauseIsNoLeap) {
  StampDoubt doubt(30);
  for (int i = 0; i < 60; ++i) {
    if (i == 40) doubt.pass_over();
    EXPECT_EQ(doubt.add(i * int64_t{33'333'333} + (i < 40 ? 0 : 10'000'000'000)), "");
  }
}

}  // namespace
}  // namespace dkb
