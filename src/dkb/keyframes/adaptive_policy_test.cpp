// SPDX-License-Identifier: Apache-2.0
#include "dkb/keyframes/adaptive_policy.h"

#include <gtest/gtest.h>

#include <string>

#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr int kSide = 20;  // points along each side of the wall

// A wall of 20 x 20 points, 2 m wide and 2 m before keyframe 0, which has seen it all, and frames that look at it.
class Wall {
 public:
  Wall() {
    for (int i = 0; i < kSide * kSide; ++i) names_.push_back(make_point_id(0, i));
    Keyframe k;
    k.id = 0;
    k.features = look({});
    k.points = points_;
    std::fill(k.points.begin(), k.points.end(), kNoPoint);
    map_.add_keyframe(std::move(k));
    for (int i = 0; i < kSide * kSide; ++i) {
      MapPoint p;
      p.id = make_point_id(0, i);
      p.position = position(i);
      map_.add_point(std::move(p));
      map_.observe(make_point_id(0, i), 0, i);
    }
  }

  // The frame `frame` at `pose`, which tracks the first `tracked` points.
  KeyframeContext query(FrameIndex frame, const Rigid3& cam_from_world, int tracked = kSide * kSide) {
    features_ = look(cam_from_world);
    std::fill(points_.begin() + tracked, points_.end(), kNoPoint);
    KeyframeContext q;
    q.frame = frame;
    q.last_keyframe_frame = 0;
    q.last_keyframe = 0;
    q.tracked_points = tracked;
    q.tracked_close_points = tracked;
    q.reference_points = kSide * kSide;
    q.cam_from_world = cam_from_world;
    q.points = &points_;
    q.features = features_.get();
    q.explain = true;
    return q;
  }

  const Map& map() const { return map_; }
  // Every point becomes one that was born beside it, as when a loop closes.
  void fuse_all() {
    for (int i = 0; i < kSide * kSide; ++i) {
      MapPoint p;
      p.id = names_[static_cast<size_t>(i)] = make_point_id(0, kSide * kSide + i);
      p.position = position(i);
      map_.add_point(std::move(p));
      map_.fuse(make_point_id(0, i), names_[static_cast<size_t>(i)]);
    }
  }

 private:
  static Eigen::Vector3d position(int i) { return {0.1 * (i % kSide) - 0.95, 0.1 * (i / kSide) - 0.95, 2}; }

  std::shared_ptr<const RgbdFeatures> look(const Rigid3& cam_from_world) {
    auto features = std::make_shared<RgbdFeatures>();
    points_.clear();
    for (int i = 0; i < kSide * kSide; ++i) {
      Keypoint k;
      k.pixel = k.image_pixel = CameraModel().project(cam_from_world * position(i)).cast<float>();
      features->keypoints.push_back(k);
      points_.push_back(names_[static_cast<size_t>(i)]);
    }
    features->descriptors.resize(features->keypoints.size());
    return features;
  }

  std::shared_ptr<const RgbdFeatures> features_;
  std::vector<PointId> points_, names_;  // names_: by position on the wall
  Map map_;
};

Rigid3 moved_by(double metres) {
  return Rigid3(Eigen::Quaterniond::Identity(), {metres, 0, 0}).inverse();
}

AdaptiveKeyframeOptions all_levels() {
  AdaptiveKeyframeOptions options;
  options.similarity = Similarity::pks;
  options.visibility_levels = 9;
  options.floor_reference_ratio = 0.25;
  options.floor_kept_ratio = 0;
  options.translation_unit = TranslationUnit::centimetre;
  return options;
}

TEST(AdaptiveKeyframes, AreNotMadeWhileTheCameraIsStill) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  for (int i = 1; i < 50; ++i) {
    const KeyframeDecision d = policy.decide(wall.query(i, {}), wall.map());
    EXPECT_FALSE(d.insert);
    EXPECT_FALSE(d.tests.parallax);
  }
}

TEST(AdaptiveKeyframes, AreMadeWhenGateAndVotesAgree) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  EXPECT_FALSE(policy.decide(wall.query(1, moved_by(0.01)), wall.map()).insert);
  const KeyframeDecision d = policy.decide(wall.query(2, moved_by(0.6)), wall.map());
  EXPECT_TRUE(d.tests.parallax);
  EXPECT_TRUE(d.tests.visibility);
  EXPECT_TRUE(d.tests.spread);
  EXPECT_TRUE(d.insert);
  EXPECT_EQ(d.rule, KeyframeRule::adaptive);
}

TEST(AdaptiveKeyframes, CountTheLevelsThatChanged) {
  // The wall faces the keyframe: a point (x, y, 2) is seen at the angle whose tangent is |(x, y)| / 2, and after 0.6 m
  // to the right at |(x - 0.6, y)| / 2. With two levels a point is in the first within 2 tan(10 deg) = 0.35265 of the
  // middle. Coordinates are odd multiples of 0.05: 3 of them in |y| go with |x| = 0.05 (hypot(0.05, 0.35) = 0.3536 is
  // beyond), 3 with 0.15, 2 with 0.25, none with 0.35: 4 * (3 + 3 + 2) = 32 points. As many lie around (0.6, 0), none
  // in both discs.
  Wall wall;
  AdaptiveKeyframeOptions options = all_levels();
  options.visibility_levels = 2;
  AdaptiveKeyframePolicy policy(options, 640, 480);
  EXPECT_FALSE(policy.decide(wall.query(1, {}), wall.map()).insert);
  const KeyframeDecision d = policy.decide(wall.query(2, moved_by(0.6)), wall.map());
  EXPECT_NE(d.explanation.find("changed 64 of 400 matches (reference 0 of 400, points 400 / 400)"), std::string::npos)
      << d.explanation;
}

TEST(AdaptiveKeyframes, KnowPointsThatWereFusedMeanwhile) {
  Wall wall;
  AdaptiveKeyframeOptions options = all_levels();
  options.visibility_levels = 2;
  AdaptiveKeyframePolicy policy(options, 640, 480);
  policy.decide(wall.query(1, {}), wall.map());
  policy.decide(wall.query(2, moved_by(0.6)), wall.map());
  wall.fuse_all();
  const KeyframeDecision d = policy.decide(wall.query(3, moved_by(1.2)), wall.map());
  EXPECT_NE(d.explanation.find(" of 400 matches (reference 0 of 400,"), std::string::npos) << d.explanation;
}

TEST(AdaptiveKeyframes, WaitForTwoFrames) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  const KeyframeDecision d = policy.decide(wall.query(1, moved_by(0.6), 40), wall.map());
  EXPECT_TRUE(d.tests.parallax);
  EXPECT_TRUE(d.tests.few_points);
  EXPECT_FALSE(d.insert);
  EXPECT_TRUE(policy.decide(wall.query(2, moved_by(0.6), 40), wall.map()).insert);
}

TEST(AdaptiveKeyframes, NeedTheMatchesSpread) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  policy.decide(wall.query(1, {}), wall.map());
  // Only the upper third of the wall is matched: the balance is small, the offset large.
  const KeyframeDecision d = policy.decide(wall.query(2, moved_by(0.6), 140), wall.map());
  EXPECT_TRUE(d.tests.visibility);
  EXPECT_FALSE(d.tests.spread);
  EXPECT_FALSE(d.insert);
}

TEST(AdaptiveKeyframes, LeaveItToTheFloorUntilTheLastKeyframeIsMapped) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  const Map empty;
  policy.decide(wall.query(1, moved_by(0.01)), empty);
  const KeyframeDecision d = policy.decide(wall.query(2, moved_by(0.6)), empty);
  EXPECT_TRUE(d.tests.parallax);
  EXPECT_FALSE(d.insert);
  EXPECT_EQ(policy.decide(wall.query(3, moved_by(0.6), 40), empty).rule, KeyframeRule::floor);
  EXPECT_EQ(policy.decide(wall.query(4, moved_by(0.6)), wall.map()).rule, KeyframeRule::adaptive);
}

TEST(AdaptiveKeyframes, HaveNoVoteWithoutMatches) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  policy.decide(wall.query(1, {}), wall.map());
  const KeyframeDecision d = policy.decide(wall.query(2, moved_by(0.6), 0), wall.map());  // n_matches = 0
  EXPECT_TRUE(d.tests.parallax);
  EXPECT_FALSE(d.tests.visibility);
  EXPECT_FALSE(d.tests.spread);
  EXPECT_EQ(d.rule, KeyframeRule::floor);
  AdaptiveKeyframePolicy blind(all_levels(), 640, 480);
  blind.decide(wall.query(1, {}, 0), wall.map());  // r = C = 0
  EXPECT_FALSE(blind.decide(wall.query(2, moved_by(0.6)), wall.map()).tests.visibility);
}

TEST(AdaptiveKeyframes, TheFloorKeepsTrackingAlive) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  KeyframeContext q = wall.query(2, {}, 150);
  EXPECT_FALSE(policy.decide(q, wall.map()).insert);
  q.reference_points = 601;  // 150 < 0.25 * 601
  EXPECT_EQ(policy.decide(q, wall.map()).rule, KeyframeRule::floor);
  q.reference_points = 600;
  EXPECT_FALSE(policy.decide(q, wall.map()).insert);
  q.tracked_close_points = 99;
  q.creatable_close_points = 70;
  EXPECT_TRUE(policy.decide(q, wall.map()).tests.close_points);
  EXPECT_EQ(policy.decide(q, wall.map()).rule, KeyframeRule::floor);
  q.creatable_close_points = 69;
  EXPECT_FALSE(policy.decide(q, wall.map()).insert);
  q.tracked_points = 49;
  EXPECT_TRUE(policy.decide(q, wall.map()).tests.few_points);
  EXPECT_EQ(policy.decide(q, wall.map()).rule, KeyframeRule::floor);
}

TEST(AdaptiveKeyframes, TheFloorLooksAtWhatIsLeftOfTheReferenceFrame) {
  Wall wall;
  AdaptiveKeyframeOptions options = all_levels();
  options.floor_kept_ratio = 0.5;
  AdaptiveKeyframePolicy policy(options, 640, 480);
  policy.decide(wall.query(1, {}, 320), wall.map());  // the reference frame
  EXPECT_FALSE(policy.decide(wall.query(2, {}, 160), wall.map()).insert);
  const KeyframeDecision d = policy.decide(wall.query(3, {}, 159), wall.map());
  EXPECT_TRUE(d.tests.view_left);
  EXPECT_EQ(d.rule, KeyframeRule::floor);
}

TEST(AdaptiveKeyframes, ThePapersNumbersStayAsPrinted) {
  const AdaptiveKeyframeOptions paper = paper_keyframe_options();
  EXPECT_EQ(paper.translation_unit, TranslationUnit::centimetre);
  EXPECT_EQ(paper.similarity, Similarity::printed);
  EXPECT_EQ(paper.visibility_levels, 4);
  EXPECT_EQ(paper.normals, NormalSum::plain);
  EXPECT_EQ(paper.floor_reference_ratio, 0.25);
  EXPECT_EQ(paper.floor_kept_ratio, 0);
}

TEST(AdaptiveKeyframes, MayMeasureTheWayByTheDepth) {
  Wall wall;  // without depths a percent of the depth is a centimetre; with depths of 4 m the same way counts a quarter
  AdaptiveKeyframeOptions options = all_levels();
  options.translation_unit = TranslationUnit::depth_percent;
  const KeyframeContext unknown = wall.query(1, moved_by(0.4));
  EXPECT_NE(AdaptiveKeyframePolicy(options, 640, 480).decide(unknown, wall.map()).explanation.find("deg + 40.00"),
            std::string::npos);
  KeyframeContext far = wall.query(1, moved_by(0.4));
  RgbdFeatures deep = *far.features;
  for (Keypoint& k : deep.keypoints) k.depth = 4;
  far.features = &deep;
  EXPECT_NE(AdaptiveKeyframePolicy(options, 640, 480).decide(far, wall.map()).explanation.find("deg + 10.00"),
            std::string::npos);
}

TEST(AdaptiveKeyframes, DoNotDependOnWhereTheWorldLies) {
  const auto decisions = [](const Rigid3& moved_world) {
    Wall wall;
    AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
    std::string result;
    for (int i = 1; i < 8; ++i) {
      KeyframeContext q = wall.query(i, moved_by(0.05 * i));
      // The reference frame was in the old world; from frame 2 on poses are in a world that a correction has moved.
      if (i > 1) {
        q.cam_from_world = q.cam_from_world * moved_world;
        q.last_keyframe_cam_from_world = q.last_keyframe_cam_from_world * moved_world;
      }
      const KeyframeDecision d = policy.decide(q, wall.map());
      result += d.tests.visibility ? 'v' : '-';
      result += d.insert ? 'k' : '.';
    }
    return result;
  };
  EXPECT_EQ(decisions({}), decisions(Rigid3(rotation_from_vector({0.1, 0.2, 0.3}), {1, 2, 3})));
  EXPECT_NE(decisions({}).find('k'), std::string::npos);
}

TEST(AdaptiveKeyframes, ExplainThemselvesWhenAsked) {
  Wall wall;
  AdaptiveKeyframePolicy policy(all_levels(), 640, 480);
  KeyframeContext q = wall.query(1, {});
  EXPECT_NE(policy.decide(q, wall.map()).explanation.find("parallax 0.00 deg + 0.00 against T 30.00 (F 0.000): no"),
            std::string::npos);
  EXPECT_NE(
      policy.decide(q, wall.map())
          .explanation.find("; votes not asked; tracked 400 (at least 50: yes), at least 0.25 of the reference's 400"),
      std::string::npos);
  q = wall.query(5, moved_by(0.6));
  EXPECT_NE(policy.decide(q, wall.map()).explanation.find("matches (reference"), std::string::npos);
  EXPECT_TRUE(policy.decide(q, wall.map()).tests.votes_asked);
  q.explain = false;
  EXPECT_TRUE(policy.decide(q, wall.map()).explanation.empty());
}

}  // namespace
}  // namespace dkb
