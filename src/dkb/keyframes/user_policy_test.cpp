// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/user_policy.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

// Remembers what it was asked, and gives a fixed answer.
class ScriptedPolicy final : public KeyframePolicy {
 public:
  KeyframeAnswer decide(const KeyframeQuery& query) override {
    asked.push_back(query);
    return answer;
  }
  void reset() override { ++resets; }

  KeyframeAnswer answer;
  std::vector<KeyframeQuery> asked;
  int resets = 0;
};

class UserPolicyTest : public ::testing::Test {
 protected:
  // A map of one keyframe that shows points 0:0 and 0:1, the second of which mapping has not worked in.
  UserPolicyTest() : features(std::make_shared<RgbdFeatures>()) {
    features->keypoints.resize(4);
    features->descriptors.resize(4);
    for (size_t f = 0; f < 4; ++f) features->keypoints[f].pixel = {10.0f * static_cast<float>(f), 5};
    Keyframe k;
    k.id = 0;
    k.features = features;
    k.parent = kNoKeyframe;
    k.points.assign(4, kNoPoint);
    map.add_keyframe(k);
    MapPoint p;
    p.id = make_point_id(0, 0);
    p.position = {0, 0, 2};
    map.add_point(p);
    map.observe(p.id, 0, 0);
    points = {kNoPoint, make_point_id(0, 0), make_point_id(0, 1), make_point_id(0, 2)};
    context.positions = {std::nullopt, Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(1, 0, 2), std::nullopt};
    context.frame = 25;
    context.last_keyframe_frame = 20;
    context.stamp_ns = 1'500'000'000;
    context.last_keyframe_stamp_ns = 1'250'000'000;
    context.last_keyframe = 0;
    context.mapper_idle = false;
    context.tracked_close_points = 7;
    context.creatable_close_points = 8;
    context.reference_points = 9;
    context.cam_from_world.translation = {-1, 0, 0};
    context.last_keyframe_cam_from_world.translation = {-2, 0, 0};
    context.points = &points;
    context.features = features.get();
  }

  Map map;
  std::shared_ptr<RgbdFeatures> features;
  std::vector<PointId> points;
  KeyframeContext context;
  std::shared_ptr<ScriptedPolicy> policy = std::make_shared<ScriptedPolicy>();
};

TEST_F(UserPolicyTest, BeginsAnewWithEveryMap) {
  UserKeyframeDecider decider(policy);
  EXPECT_EQ(policy->resets, 1);
}

TEST_F(UserPolicyTest, IsAskedInTheApisTerms) {
  UserKeyframeDecider(policy).decide(context, map);
  ASSERT_EQ(policy->asked.size(), 1U);
  const KeyframeQuery& q = policy->asked[0];
  EXPECT_EQ(q.frame, 25);
  EXPECT_EQ(q.stamp_ns, 1'500'000'000);
  EXPECT_EQ(q.frames_since_keyframe, 5);
  EXPECT_DOUBLE_EQ(q.seconds_since_keyframe, 0.25);
  EXPECT_FALSE(q.mapper_idle);
  EXPECT_EQ(q.tracked_close_points, 7);
  EXPECT_EQ(q.creatable_close_points, 8);
  EXPECT_EQ(q.reference_points, 9);
  EXPECT_EQ(q.world_from_cam.translation.x(), 1);
  EXPECT_EQ(q.world_from_last_keyframe.translation.x(), 2);
  ASSERT_EQ(q.points.size(), 2U) << "inliers whose place is known";
  EXPECT_EQ(q.points[0].pixel.x(), 10);
  EXPECT_EQ(q.points[0].position_in_world.z(), 2);
  EXPECT_EQ(q.points[0].keyframes, 1);
  EXPECT_TRUE(q.points[0].in_last_keyframe);
  EXPECT_EQ(q.points[1].keyframes, 0) << "mapping has not worked it in yet";
  EXPECT_FALSE(q.points[1].in_last_keyframe);
}

TEST_F(UserPolicyTest, ItsAnswerCounts) {
  UserKeyframeDecider decider(policy);
  policy->answer = {true, "moved 0.3 m"};
  const KeyframeDecision yes = decider.decide(context, map);
  EXPECT_TRUE(yes.insert);
  EXPECT_EQ(explained(yes), "keyframe (own): moved 0.3 m");
  policy->answer = {};
  const KeyframeDecision no = decider.decide(context, map);
  EXPECT_FALSE(no.insert);
  EXPECT_EQ(no.rule, KeyframeRule::none);
}

}  // namespace
}  // namespace dkb
