// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/match_quality.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

// 80 of 100 matches are left, 60 of them with another level; 150 points tracked against the reference frame's 200.
MatchCounts counts() {
  MatchCounts n;
  n.matches = 80;
  n.changed = 60;
  n.points = 150;
  n.reference_matches = 100;
  n.reference_changed = 10;
  n.reference_points = 200;
  return n;
}

TEST(MatchQuality, FollowsThePrintedFormulas) {
  EXPECT_NEAR(match_similarity(counts(), Similarity::printed), 60 * 0.8 + 60 * 0.75, 1e-12);  // DKB eq. 34: 93
  EXPECT_NEAR(match_loss(counts()), 0.2, 1e-12);                                              // DKB eq. 35
  EXPECT_NEAR(changed_excess(counts()), 0.25, 1e-12);                                         // DKB eq. 36
  EXPECT_NEAR(changed_growth(counts()), 0.65, 1e-12);                                         // DKB eq. 37: 0.75 - 0.1
  // DKB eq. 33: (0.2 - 0.65 - 0.25) * 93 + 93 = 27.9.
  EXPECT_NEAR(changed_threshold(0.2, 0.25, 0.65, 93, Similarity::printed), 27.9, 1e-12);
}

TEST(MatchQuality, FollowsItsSource) {
  EXPECT_NEAR(match_similarity(counts(), Similarity::pks), (10 * 0.8 + 10 * 0.75) / 2, 1e-12);  // 7.75
  EXPECT_NEAR(changed_threshold(0.2, 0.25, 0.65, 7.75, Similarity::pks), 0.3 * 7.75, 1e-12);
  EXPECT_NEAR(changed_threshold(0.09, 0.25, 0.65, 7.75, Similarity::pks), 1.1 * 7.75, 1e-12);  // theta < 0.1
  EXPECT_NEAR(changed_threshold(0.1, 0.25, 0.65, 7.75, Similarity::pks), 0.2 * 7.75, 1e-12);
}

TEST(MatchQuality, TheSourcesSimilarityHasAFloor) {
  MatchCounts n = counts();
  n.reference_changed = 0;
  EXPECT_NEAR(match_similarity(n, Similarity::pks), 0.05 * 80, 1e-12);
}

TEST(VisibilityVote, IsForAKeyframeWhenManyLevelsChanged) {
  const VisibilityVote vote = vote_by_visibility(counts(), Similarity::printed);
  EXPECT_TRUE(vote.defined);
  EXPECT_NEAR(vote.threshold, 27.9, 1e-12);
  EXPECT_TRUE(vote.votes);  // 60 > 27.9
  // 40 changed: S = 62, alpha = 0, beta = 0.4, threshold = (0.2 - 0.4) * 62 + 62 = 49.6.
  MatchCounts n = counts();
  n.changed = 40;
  EXPECT_NEAR(vote_by_visibility(n, Similarity::printed).threshold, 49.6, 1e-12);
  EXPECT_FALSE(vote_by_visibility(n, Similarity::printed).votes);
  EXPECT_TRUE(vote_by_visibility(n, Similarity::pks).votes);  // S = 7.75, threshold = 0.8 * 7.75
}

TEST(VisibilityVote, NeedsMoreThanTheThreshold) {
  MatchCounts n = counts();
  n.changed = 0;  // printed: S and the threshold are 0
  EXPECT_EQ(vote_by_visibility(n, Similarity::printed).threshold, 0);
  EXPECT_FALSE(vote_by_visibility(n, Similarity::printed).votes);
}

TEST(VisibilityVote, IsNotThereWithoutMatchesOrReference) {
  for (int MatchCounts::*count :
       {&MatchCounts::matches, &MatchCounts::reference_matches, &MatchCounts::reference_points})
    for (Similarity similarity : {Similarity::printed, Similarity::pks}) {
      MatchCounts n = counts();
      n.*count = 0;
      if (count == &MatchCounts::matches) n.changed = 0;
      EXPECT_FALSE(vote_by_visibility(n, similarity).defined);
      EXPECT_FALSE(vote_by_visibility(n, similarity).votes);
    }
}

}  // namespace
}  // namespace dkb
