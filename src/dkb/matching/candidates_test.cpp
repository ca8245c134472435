// SPDX-License-Identifier: Apache-2.0
#include "dkb/matching/candidates.h"

#include <gtest/gtest.h>

#include "dkb/util/random.h"

namespace dkb {
namespace {

// A descriptor at `bits` bits from the empty one.
Descriptor bits_set(int bits) {
  Descriptor d{};
  for (int b = 0; b < bits; ++b) d[static_cast<size_t>(b / 64)] |= uint64_t{1} << (b % 64);
  return d;
}

// fx = fy = 500, centre (320, 240): a point at depth 2 m moves 250 px per metre.
CameraModel simple_camera() {
  CameraModel camera;
  camera.fx = camera.fy = 500;
  camera.cx = 320;
  camera.cy = 240;
  return camera;
}

class CandidateMatching : public ::testing::Test {
 protected:
  // A candidate that projects onto (u, v) from depth z, found on `level` from there.
  Candidate at(double u, double v, const Descriptor& descriptor = {}, int level = 0, double z = 2.0) const {
    Candidate c;
    c.id = 1;
    c.position = camera.unproject({u, v}, z);
    c.normal.setZero();
    c.reference_distance = static_cast<float>(c.position.norm());
    c.reference_scale = static_cast<float>(std::pow(1.2, level));
    c.descriptor = descriptor;
    return c;
  }
  void add_feature(float u, float v, const Descriptor& descriptor, int octave = 0, float angle = 0) {
    Keypoint k;
    k.pixel = k.image_pixel = {u, v};
    k.octave = static_cast<uint8_t>(octave);
    k.angle = angle;
    features.keypoints.push_back(k);
    features.descriptors.push_back(descriptor);
  }
  std::vector<ProjectionMatch> match(const std::vector<Candidate>& candidates,
                                     const std::vector<uint8_t>* taken = nullptr,
                                     std::vector<uint8_t>* visible = nullptr) {
    features.grid = KeypointGrid(features.keypoints, camera.width, camera.height);
    return match_by_projection(candidates, {features, motion}, {camera, {}}, cam_from_world, options, taken, visible);
  }

  CameraModel camera = simple_camera();
  RgbdFeatures features;
  std::vector<FeatureMotion> motion;
  ProjectionMatchOptions options;
  Rigid3 cam_from_world;
};

TEST_F(CandidateMatching, FindsTheNearestDescriptorWithinTheRadius) {
  add_feature(103, 103, bits_set(20));  // 3 px off in both, within the radius of 4
  add_feature(101, 100, bits_set(60));
  add_feature(105, 100, bits_set(0));  // perfect, but 5 px off
  const auto m = match({at(100, 100)});
  ASSERT_EQ(m.size(), 1U);
  EXPECT_EQ(m[0].feature, 0);
  EXPECT_EQ(m[0].candidate, 0);
  EXPECT_EQ(m[0].distance, 20);
}

TEST_F(CandidateMatching, InViewIsWhatTheImageAsReadShows) {
  // A barrel-shaped image shows at its left border what an ideal one would show 30 px outside.
  camera.k1 = -0.2;
  const Eigen::Vector2d ideal = camera.undistort({5, 240});
  ASSERT_LT(ideal.x(), -20);
  add_feature(static_cast<float>(ideal.x()), 240, {});
  features.keypoints[0].image_pixel = {5, 240};
  EXPECT_EQ(match({at(ideal.x(), 240)}).size(), 1U);
  const Eigen::Vector2d outside = camera.undistort({-5, 240});
  std::vector<uint8_t> visible{0};
  match({at(outside.x(), 240)}, nullptr, &visible);
  EXPECT_EQ(visible[0], 0);
}

TEST_F(CandidateMatching, ProjectsWithThePose) {
  // The camera stands 0.1 m to the right: at 2 m everything moves 25 px to the left.
  cam_from_world.translation = {-0.1, 0, 0};
  add_feature(275, 100, bits_set(0));
  EXPECT_EQ(match({at(300, 100)}).size(), 1U);
  cam_from_world = {};
  EXPECT_TRUE(match({at(300, 100)}).empty());
}

TEST_F(CandidateMatching, WhereAMoverIsSuspectedOnlyEstablishedPointsAreFoundAndOnlyAtTheirDepth) {
  add_feature(100, 100, bits_set(0));
  Keypoint& k = features.keypoints[0];
  motion = {FeatureMotion::on_mover};
  Candidate c = at(100, 100);  // 2 m away
  k.depth = 2.0f;
  EXPECT_TRUE(match({c}).empty());
  c.established = true;
  EXPECT_EQ(match({c}).size(), 1U);
  k.depth = 1.9f;
  EXPECT_TRUE(match({c}).empty());
  k.depth = 0;  // beside somebody near the sensor often has none
  EXPECT_EQ(match({c}).size(), 1U);
}

TEST_F(CandidateMatching, AFeatureBesideAnOutlineShowsNothingNearerThanTheSurfacesThere) {
  add_feature(100, 100, bits_set(0));
  features.keypoints[0].lent_depth = 3.0F;
  EXPECT_TRUE(match({at(100, 100)}).empty());  // 2 m away
  EXPECT_EQ(match({at(100, 100, {}, 0, 2.9)}).size(), 1U);
  EXPECT_EQ(match({at(100, 100, {}, 0, 5.0)}).size(), 1U);
}

TEST_F(CandidateMatching, AFeatureGoesToTheNearerCandidateWhateverTheirOrder) {
  add_feature(100, 100, bits_set(10));
  const Candidate near = at(101, 100, bits_set(12)), far = at(99, 100, bits_set(20));
  for (const bool near_first : {true, false}) {
    const auto m = match(near_first ? std::vector{near, far} : std::vector{far, near});
    ASSERT_EQ(m.size(), 1U);
    EXPECT_EQ(m[0].candidate, near_first ? 0 : 1);
    EXPECT_EQ(m[0].distance, 2);
  }
}

TEST_F(CandidateMatching, EqualCandidatesAreSettledByTheirOrder) {
  add_feature(100, 100, bits_set(10));
  const auto m = match({at(101, 100), at(99, 100)});
  ASSERT_EQ(m.size(), 1U);
  EXPECT_EQ(m[0].candidate, 0);
}

TEST_F(CandidateMatching, ResultsComeByFeature) {
  add_feature(500, 400, bits_set(1));
  add_feature(100, 100, bits_set(2));
  const auto m = match({at(100, 100), at(500, 400)});
  ASSERT_EQ(m.size(), 2U);
  EXPECT_EQ(m[0].feature, 0);
  EXPECT_EQ(m[0].candidate, 1);
  EXPECT_EQ(m[1].feature, 1);
  EXPECT_EQ(m[1].candidate, 0);
}

TEST_F(CandidateMatching, LeavesTakenFeaturesAlone) {
  add_feature(100, 100, bits_set(0));
  add_feature(102, 100, bits_set(30));
  const std::vector<uint8_t> taken = {1, 0};
  const auto m = match({at(100, 100)}, &taken);
  ASSERT_EQ(m.size(), 1U);
  EXPECT_EQ(m[0].feature, 1);
}

TEST_F(CandidateMatching, TheLargestDistanceIsStillAMatch) {
  add_feature(100, 100, bits_set(64));
  EXPECT_EQ(match({at(100, 100)}).size(), 1U);
  features.descriptors[0] = bits_set(65);
  EXPECT_TRUE(match({at(100, 100)}).empty());
}

TEST_F(CandidateMatching, AmbiguousMatchesOfOneLevelAreRejected) {
  add_feature(100, 100, bits_set(41));
  add_feature(102, 100, bits_set(50), 0);
  EXPECT_TRUE(match({at(100, 100)}).empty());  // 41 > 0.8 * 50
  features.descriptors[0] = bits_set(40);      // 40 = 0.8 * 50
  EXPECT_EQ(match({at(100, 100)}).size(), 1U);
  features.descriptors[0] = bits_set(41);
  features.keypoints[1].octave = 1;  // the same corner on the next level is no rival
  EXPECT_EQ(match({at(100, 100)}).size(), 1U);
}

TEST_F(CandidateMatching, VisibleAreThoseInTheImageWithinThePyramidsScalesAndSeenFromTheirSide) {
  Candidate behind = at(100, 100);
  behind.position.z() = -2;
  Candidate towards = at(320, 240), away = towards, unknown = towards;
  towards.normal = {0, 0, -1};
  away.normal = {0, 0, 1};
  Candidate oblique = towards;  // 61 degrees from its mean direction: the cosine is 0.485
  oblique.normal = {static_cast<float>(std::sin(61 * M_PI / 180)), 0, static_cast<float>(-std::cos(61 * M_PI / 180))};
  // Levels 0 ... 7 of scale 1.2 reach from 1 / 1.2^1.5 = 0.76 to 1.2^8.5 = 4.7 times the reference.
  Candidate too_far = at(320, 240), too_near = at(320, 240), far_enough = at(320, 240), near_enough = at(320, 240);
  too_far.reference_scale = 0.75F;
  far_enough.reference_scale = 0.77F;
  near_enough.reference_scale = 4.6F;
  too_near.reference_scale = 4.8F;
  const std::vector<Candidate> candidates = {at(-1, 100), at(0, 0),    at(639, 479), at(641, 100), behind,
                                             towards,     away,        unknown,      oblique,      too_far,
                                             far_enough,  near_enough, too_near};
  std::vector<uint8_t> visible(candidates.size(), 0);
  match(candidates, nullptr, &visible);
  EXPECT_EQ(visible, (std::vector<uint8_t>{0, 1, 1, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0}));
}

TEST_F(CandidateMatching, LooksOnTheLevelsAroundThePredictedOne) {
  // Found on level 2 from 2 m. From 1 m the scale is 1.44 * 2 = 2.88 = 1.2^5.8: level 6.
  const Candidate c = at(320, 240, {}, 2);
  cam_from_world.translation.z() = -1;
  for (int octave = 0; octave < 8; ++octave) {
    features.keypoints.clear();
    features.descriptors.clear();
    add_feature(320, 240, bits_set(0), octave);
    EXPECT_EQ(match({c}).size(), octave >= 5 ? 1U : 0U) << "level " << octave;
  }
}

TEST_F(CandidateMatching, TheRadiusGrowsWithThePredictedScale) {
  add_feature(107, 100, bits_set(0), 3);  // 4 px * 1.2^3 = 6.9 px; on level 4 8.3 px
  EXPECT_TRUE(match({at(100, 100, {}, 3)}).empty());
  EXPECT_EQ(match({at(100, 100, {}, 4)}).size(), 1U);
}

TEST_F(CandidateMatching, KnownOrientationsMustAgree) {
  add_feature(100, 100, bits_set(0), 0, 6.2F);
  Candidate c = at(100, 100);
  c.angle = 0.1F;  // 0.18 rad apart over the wrap
  EXPECT_EQ(match({c}).size(), 1U);
  c.angle = 0.7F;  // 0.78 rad apart
  EXPECT_TRUE(match({c}).empty());
  c.angle = -1;
  EXPECT_EQ(match({c}).size(), 1U);
}

TEST_F(CandidateMatching, NothingMatchesNothing) {
  EXPECT_TRUE(match({}).empty());
  EXPECT_TRUE(match({at(100, 100)}).empty());
  add_feature(100, 100, bits_set(0));
  EXPECT_TRUE(match({}).empty());
}

}  // namespace
}  // namespace dkb
