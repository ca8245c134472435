// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/place_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb {
namespace {

const double kPrior = std::log(5.0);                                       // before anything is seen
const double kSame = std::log(0.98 / 0.9), kOther = std::log(0.02 / 0.1);  // the odds of one detail

// Five points in each of so many cubes of 0.3 m, in a row.
class PlaceEvidenceTest : public ::testing::Test {
 protected:
  static constexpr int kOfEach = 5;
  PlaceEvidenceTest() {
    for (int i = 0; i < 200; ++i) {
      Candidate& p = points.emplace_back();
      p.id = make_point_id(0, i);
      p.position = {0.3 * (i / kOfEach) + 0.01 + 0.05 * (i % kOfEach), 0.1, 2};
    }
  }
  // What a view of the details in [first, last) shows, of which these points look different.
  std::vector<PointLook> view(int first, int last, const std::vector<int>& others = {}) const {
    std::vector<PointLook> looks;
    for (int i = kOfEach * first; i < kOfEach * last; ++i) looks.push_back({points[static_cast<size_t>(i)].id, true});
    for (int other : others) looks[static_cast<size_t>(other - kOfEach * first)].same = false;
    return looks;
  }

  std::vector<Candidate> points;
  PlaceEvidence evidence;
};

TEST_F(PlaceEvidenceTest, NothingSeenTellsNothing) {
  EXPECT_EQ(evidence.log_odds(points), kPrior);
}

TEST_F(PlaceEvidenceTest, ADetailCountsOnceHoweverOftenItIsSeen) {
  evidence.add(view(0, 10));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + 10 * kSame, 1e-12);
  evidence.add(view(0, 10));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + 10 * kSame, 1e-12);
  evidence.add(view(5, 15));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + 15 * kSame, 1e-12);
}

TEST_F(PlaceEvidenceTest, AThingThatLooksDifferentSpeaksForALookAlike) {
  evidence.add(view(0, 20, {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14}));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + 17 * kSame + 3 * kOther, 1e-12);
  EXPECT_LT(evidence.log_odds(points), 0);
}

TEST_F(PlaceEvidenceTest, CornersThatFailOneByOneDoNot) {
  evidence.add(view(0, 20, {0, 5, 10, 15, 20, 25, 30}));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + 20 * kSame, 1e-12);
  evidence.clear();
  evidence.add(view(0, 20, {0, 1, 2}));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + 19 * kSame, 1e-12) << "two of five alike: the detail says nothing";
}

TEST_F(PlaceEvidenceTest, OnlyThePointsOfAPlaceSpeakForIt) {
  evidence.add(view(0, 4, {0, 1, 2, 3, 4}));
  const std::vector<Candidate> others(points.begin() + kOfEach, points.end());
  EXPECT_NEAR(evidence.log_odds(others), kPrior + 3 * kSame, 1e-12);
  const std::vector<Candidate> few(points.begin() + kOfEach, points.begin() + kOfEach + 3);
  EXPECT_EQ(evidence.log_odds(few), kPrior) << "three points are no detail";
}

TEST_F(PlaceEvidenceTest, WhatWasSeenBeforeIsOutvotedInTenViews) {
  for (int i = 0; i < 1000; ++i) evidence.add(view(0, 1, {0, 1, 2, 3, 4}));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + kOther, 1e-12);
  for (int i = 0; i < 11; ++i) evidence.add(view(0, 1));
  EXPECT_NEAR(evidence.log_odds(points), kPrior + kSame, 1e-12);
}

TEST_F(PlaceEvidenceTest, APointNamedTwiceCountsOnce) {
  auto looks = view(0, 1);
  looks.push_back({points[0].id, false});
  looks.push_back({points[0].id, false});
  evidence.add(looks);
  EXPECT_NEAR(evidence.log_odds(points), kPrior + kSame, 1e-12);
}

}  // namespace
}  // namespace dkb
