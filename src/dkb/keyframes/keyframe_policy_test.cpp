// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/keyframe_policy.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

TEST(KeyframeTestCounts, CountEachTestThatSpokeForAKeyframe) {
  KeyframeTestCounts counts;
  counts.add({});
  KeyframeTests votes;
  votes.waited = votes.parallax = votes.votes_asked = votes.visibility = votes.spread = true;
  counts.add(votes);
  KeyframeTests halves;
  halves.parallax = halves.votes_asked = halves.spread = true;
  counts.add(halves);
  KeyframeTests floor;
  floor.few_points = floor.close_points = floor.view_left = true;
  counts.add(floor);
  counts.add(floor);
  const std::map<std::string, int> expected{{"decisions", 5},   {"waited", 1},       {"parallax", 2},
                                            {"votes_asked", 2}, {"visibility", 1},   {"spread", 2},
                                            {"few_points", 2},  {"close_points", 2}, {"view_left", 2}};
  EXPECT_EQ(counts.by_name(), expected);
  EXPECT_EQ(KeyframeTestCounts().by_name().size(), expected.size()) << "none is left out before it speaks";
}

TEST(KeyframeDecision, IsExplainedInOneLine) {
  EXPECT_EQ(explained({true, KeyframeRule::floor, "tracked 40"}), "keyframe (floor): tracked 40");
  EXPECT_EQ(explained({false, KeyframeRule::none, "tracked 400"}), "no keyframe: tracked 400");
}

TEST(KeyframeDecision, NamesItsRuleAndTheTestsOfTheFloor) {
  KeyframeDecision decision{true, KeyframeRule::floor, "", {}};
  decision.tests.few_points = decision.tests.view_left = true;
  EXPECT_EQ(rule_of(decision), "floor (few points, view left)");
  decision.rule = KeyframeRule::adaptive;
  EXPECT_EQ(rule_of(decision), "adaptive");
}

TEST(KeyframeRule, RulesHaveTheNamesOfTheStatistics) {
  EXPECT_STREQ(name_of(KeyframeRule::first), "first");
  EXPECT_STREQ(name_of(KeyframeRule::baseline), "baseline");
  EXPECT_STREQ(name_of(KeyframeRule::adaptive), "adaptive");
  EXPECT_STREQ(name_of(KeyframeRule::floor), "floor");
  EXPECT_STREQ(name_of(KeyframeRule::none), "none");
}

}  // namespace
}  // namespace dkb
