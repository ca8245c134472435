// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/keyframes/keyframe_policy.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

// A frame that just calls for a keyframe: 169 of the reference's 200 points are tracked, the limit being 0.85 * 200 =
// 170.
KeyframeContext due() {
  KeyframeContext q;
  q.frame = 100;
  q.last_keyframe_frame = 90;
  q.mapper_idle = true;
  q.tracked_points = 169;
  q.reference_points = 200;
  q.tracked_close_points = 150;
  q.creatable_close_points = 0;
  return q;
}

KeyframeDecision decide(const KeyframeContext& q) {
  const Map map;
  return BaselineKeyframePolicy().decide(q, map);
}

TEST(BaselineKeyframes, AreMadeWhenTheReferencesViewIsLeft) {
  KeyframeContext q = due();
  const KeyframeDecision decision = decide(q);
  EXPECT_TRUE(decision.insert);
  EXPECT_EQ(decision.rule, KeyframeRule::baseline);
  q.tracked_points = 170;
  EXPECT_FALSE(decide(q).insert);
  EXPECT_EQ(decide(q).rule, KeyframeRule::none);
}

TEST(BaselineKeyframes, SayWhichTestSpokeAndExplainItWhenAsked) {
  KeyframeContext q = due();
  EXPECT_TRUE(decide(q).tests.view_left);
  EXPECT_FALSE(decide(q).tests.close_points);
  EXPECT_TRUE(decide(q).explanation.empty());
  q.explain = true;
  EXPECT_EQ(
      decide(q).explanation,
      "tracked 169 (at least 50: yes) against 0.85 of the reference's 200: yes; close 150 (+0): no; 10 frames since "
      "the last keyframe, mapper idle: yes; settled since a relocalisation: yes");
}

TEST(BaselineKeyframes, AreMadeWhenCloseDepthsAreWasted) {
  KeyframeContext q = due();
  q.tracked_points = 200;  // the view has not been left
  q.tracked_close_points = 99;
  q.creatable_close_points = 70;
  EXPECT_TRUE(decide(q).insert);
  q.tracked_close_points = 100;
  EXPECT_FALSE(decide(q).insert) << "enough close points";
  q.tracked_close_points = 99;
  q.creatable_close_points = 69;
  EXPECT_FALSE(decide(q).insert) << "too few new ones";
}

TEST(BaselineKeyframes, WaitForTheMapperButNotForEver) {
  KeyframeContext q = due();
  q.mapper_idle = false;
  EXPECT_FALSE(decide(q).insert);
  q.last_keyframe_frame = 80;  // 20 frames ago
  EXPECT_FALSE(decide(q).insert);
  q.last_keyframe_frame = 79;
  EXPECT_TRUE(decide(q).insert);
}

TEST(BaselineKeyframes, WaitAfterARelocalisation) {
  KeyframeContext q = due();
  q.last_relocalisation_frame = 80;
  EXPECT_FALSE(decide(q).insert);
  q.last_relocalisation_frame = 79;
  EXPECT_TRUE(decide(q).insert);
}

TEST(BaselineKeyframes, NeedEnoughTrackedPoints) {
  KeyframeContext q = due();
  q.tracked_points = 50;
  EXPECT_TRUE(decide(q).insert);
  q.tracked_points = 49;
  EXPECT_FALSE(decide(q).insert);
}

}  // namespace
}  // namespace dkb
