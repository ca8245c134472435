// SPDX-License-Identifier: Apache-2.0
#include "dkb/dynamics/point_evidence.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

constexpr double kFrame = 1.0 / 30;

TEST(PointEvidence, AThirdOfASecondOnAMoverConvicts) {
  PointEvidence evidence;
  evidence.weigh(0, {}, {});
  int frames = 0;
  std::vector<PointId> convicted;
  while (convicted.empty() && frames < 100) convicted = evidence.weigh(++frames * kFrame, {1, 2}, {7, 5});
  EXPECT_EQ(convicted, (std::vector<PointId>{5, 7}));
  EXPECT_EQ(frames, 10);
  EXPECT_TRUE(evidence.weigh(++frames * kFrame, {}, {7}).empty()) << "it starts anew";
}

TEST(PointEvidence, ALookAfterFramesWithoutMoversLastsOneFrame) {
  PointEvidence evidence;
  int frame = 0;
  while (frame < 30) evidence.weigh(++frame * kFrame, {}, {});
  int looks = 0;
  while (evidence.weigh(++frame * kFrame, {}, {3}).empty() && looks < 100) ++looks;
  EXPECT_EQ(looks, 9) << "the tenth convicts";
}

TEST(PointEvidence, WhatIsFoundStillIsClearedTwiceAsFast) {
  PointEvidence evidence;
  evidence.weigh(0, {}, {});
  int frame = 0;
  for (int i = 0; i < 8; ++i) evidence.weigh(++frame * kFrame, {}, {4, 9});
  for (int i = 0; i < 5; ++i) evidence.weigh(++frame * kFrame, {1, 4, 12}, {});
  int until_4 = 0, until_9 = 0;
  for (int i = 1; i < 20; ++i)
    for (PointId p : evidence.weigh(++frame * kFrame, {}, {4, 9}))
      if (int& until = p == 4 ? until_4 : until_9; until == 0) until = i;
  EXPECT_EQ(until_4, 10) << "nothing was left of the eight frames";
  EXPECT_EQ(until_9, 2);
}

TEST(PointEvidence, PointsThatAreNoMoreAreNoSuspects) {
  PointEvidence evidence;
  EXPECT_FALSE(evidence.suspects());
  evidence.weigh(0, {}, {});
  for (int i = 1; i < 9; ++i) evidence.weigh(i * kFrame, {}, {4, 9});
  evidence.keep([](PointId p) { return p != 4; });
  EXPECT_TRUE(evidence.suspects());
  evidence.keep([](PointId) { return false; });
  EXPECT_FALSE(evidence.suspects());
}

TEST(PointEvidence, AGapCountsAsOneLook) {
  PointEvidence evidence;
  int looks = 0;
  while (evidence.weigh(10.0 * ++looks, {}, {3}).empty() && looks < 20) {
  }
  EXPECT_EQ(looks, 4);
}

}  // namespace
}  // namespace dkb
