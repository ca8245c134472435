// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/local_mapper.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/mapping/test_map.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

class Mapping : public ::testing::Test, protected PacketSource {
 protected:
  LocalMapper make(const MappingOptions& options = {}) const { return LocalMapper(scene.optics(), options); }
  static Rigid3 at(int k) { return TestScene::camera_at({0.1 * k, 0.03 * (k % 2), 0.02 * (k % 3)}, {0, 0.02 * k, 0}); }
};

TEST_F(Mapping, TheFirstKeyframeBringsItsPoints) {
  LocalMapper mapper = make();
  const KeyframePacket first = packet(at(0));
  const MapView view = mapper.process(first);
  EXPECT_EQ(view->live_keyframe_count(), 1);
  EXPECT_EQ(view->point_count(), first.new_points.size());
  EXPECT_EQ(mapper.report().points_created, static_cast<int>(first.new_points.size()));
  for (const ProvisionalPoint& n : first.new_points) {
    const MapPoint& p = *view->point(n.id);
    EXPECT_LT((p.position - scene.points[static_cast<size_t>(shown_by(n.id))]).norm(), 1e-4);
    EXPECT_EQ(p.descriptor, n.descriptor);
    EXPECT_NEAR(p.reference_distance, (p.position - centre_in_world(at(0))).norm(), 1e-4);
    EXPECT_FLOAT_EQ(p.reference_scale, n.scale);
    EXPECT_NEAR(p.normal.norm(), 1, 1e-5);
    EXPECT_GT(p.normal.cast<double>().dot(centre_in_world(at(0)) - p.position), 0) << "towards the camera";
  }
}

TEST_F(Mapping, KeyframesThatShareEnoughPointsAreCovisibleAndFormATree) {
  LocalMapper mapper = make();
  MapView view;
  for (int k = 0; k < 3; ++k) view = mapper.process(packet(at(k)));
  EXPECT_EQ(view->keyframe(0)->parent, kNoKeyframe);
  for (KeyframeId k = 1; k < 3; ++k) {
    EXPECT_NE(view->live_keyframe(view->keyframe(k)->parent), nullptr);
    EXPECT_EQ(view->keyframe(k)->covisible.size(), 2U);
    EXPECT_GE(view->keyframe(k)->covisible.back().shared_points, 15);
  }
}

TEST_F(Mapping, PublishedViewsDoNotChange) {
  LocalMapper mapper = make();
  const MapView first = mapper.process(packet(at(0)));
  const size_t points = first->point_count();
  const Eigen::Vector3d position = first->point(first->live_points()[5])->position;
  for (int k = 1; k < 4; ++k) mapper.process(packet(at(k), {.pixel_noise = 1}));
  EXPECT_EQ(first->point_count(), points);
  EXPECT_EQ(first->live_keyframe_count(), 1);
  EXPECT_EQ(first->point(first->live_points()[5])->position, position);
}

TEST_F(Mapping, LocalBundleAdjustmentCorrectsPoses) {
  LocalMapper mapper = make();
  mapper.process(packet(at(0)));
  Vector6d error;
  error << 0.01, -0.008, 0.006, 0.004, -0.003, 0.005;
  const MapView view = mapper.process(packet(at(1), rigid3_from_tangent(error) * at(1), {}, [](int) { return true; }));
  EXPECT_LT(distance_between(view->keyframe(1)->cam_from_world, at(1)), 5e-4);
  const auto times = mapper.take_times().summaries();
  EXPECT_EQ(times.at("local_ba").count, 1U);
  EXPECT_EQ(times.at("mapping").count, 2U);
}

TEST_F(Mapping, PointsThatAreRarelyFoundWhereTheyShouldBeAreDropped) {
  LocalMapper mapper = make();
  const MapView first = mapper.process(packet(at(0)));
  const auto points = first->live_points();
  KeyframePacket second = packet(at(1));
  // A point begins with found = visible = 1: 1 + 1 of 1 + 8 is below a quarter, 1 + 1 of 1 + 7 is not.
  second.visibility = {{points[10], 8, 1}, {points[11], 7, 1}};
  const MapView view = mapper.process(second);
  EXPECT_EQ(view->point(points[10]), nullptr);
  EXPECT_NE(view->point(points[11]), nullptr);
  EXPECT_EQ(mapper.report().points_culled, 1);
}

TEST_F(Mapping, PointsThatOneKeyframeAloneSeesAreDroppedAfterTheirProbation) {
  MappingOptions options;
  options.redundant_share = 1;  // every keyframe stays
  LocalMapper mapper = make(options);
  MapView view = mapper.process(packet(at(0)));
  const PointId once = view->live_points()[20];
  for (int k = 1; k <= 3; ++k) {
    EXPECT_NE(view->point(once), nullptr) << "before keyframe " << k;
    view = mapper.process(packet(at(k), {.hidden = shown_by(once)}));
  }
  EXPECT_EQ(view->point(once), nullptr) << "three keyframes later";
}

TEST_F(Mapping, DuplicatesOfAPointAreFused) {
  LocalMapper mapper = make();
  mapper.process(packet(at(0)));
  // Tracking missed every third point of the second keyframe and made it anew.
  const KeyframePacket second = packet(at(1), at(1), {}, [](int i) { return i % 3 != 0; });
  std::vector<PointId> duplicates;
  for (const ProvisionalPoint& n : second.new_points)
    if (id_of[static_cast<size_t>(shown_by(n.id))] != n.id) duplicates.push_back(n.id);
  ASSERT_GT(duplicates.size(), 30U);
  const MapView view = mapper.process(second);
  int fused = 0;
  for (PointId id : duplicates) fused += view->resolve(id) == id_of[static_cast<size_t>(shown_by(id))];
  EXPECT_GT(fused, static_cast<int>(duplicates.size()) * 9 / 10) << "into the older one of two equally well observed";
  EXPECT_GE(mapper.report().points_fused, fused);
}

TEST_F(Mapping, FusionLeavesDifferentPointsApart) {
  LocalMapper mapper = make();
  MapView view;
  for (int k = 0; k < 4; ++k) view = mapper.process(packet(at(k), {.pixel_noise = 0.5, .depth_noise = 0.005}));
  for (PointId id : view->live_points())
    for (const Observation& o : view->point(id)->observations)
      ASSERT_EQ(shows[static_cast<size_t>(o.keyframe)][static_cast<size_t>(o.feature)], shown_by(id));
}

TEST_F(Mapping, FeaturesWithoutDepthBecomePointsByTriangulation) {
  MappingOptions options;
  options.redundant_share = 1;  // every keyframe stays
  LocalMapper mapper = make(options);
  MapView view;
  for (int k = 0; k < 4; ++k) {
    // With one seed the same points lack depth in every view.
    view = mapper.process(packet(TestScene::camera_at({0.05 * k, 0, 0}), {.depth_share = 0.5}));
  }
  int without_depth = 0;
  for (PointId id : view->live_points()) {
    const MapPoint& p = *view->point(id);
    const Keypoint& k = view->keyframe(birth_keyframe(id))->features->keypoints[static_cast<size_t>(birth_feature(id))];
    without_depth += !(k.depth > 0);
    EXPECT_LT((p.position - scene.points[static_cast<size_t>(shown_by(id))]).norm(), 0.01);
  }
  EXPECT_GT(without_depth, 30);
}

TEST_F(Mapping, RedundantKeyframesAreCulledAndTheirFramesKeepTheirPlaces) {
  LocalMapper mapper = make();
  MapView view;
  std::vector<Rigid3> truth;
  for (int k = 0; k < 9; ++k) {
    truth.push_back(TestScene::camera_at({0.01 * k, 0.002 * k, 0}));  // nearly the same view nine times
    view = mapper.process(packet(truth.back()));
  }
  EXPECT_GE(mapper.report().keyframes_culled, 2);
  EXPECT_EQ(view->live_keyframe_count(), 9 - mapper.report().keyframes_culled);
  EXPECT_NE(view->live_keyframe(0), nullptr) << "the root stays";
  EXPECT_NE(view->live_keyframe(8), nullptr) << "so does the newest";
  for (KeyframeId k = 0; k < 9; ++k)
    EXPECT_LT(distance_between(view->cam_from_world(k), truth[static_cast<size_t>(k)]), 1e-3) << "keyframe " << k;
}

// In the dark, say. The motion from before it to after it remains.
TEST_F(Mapping, AKeyframeThatShowsNothingIsCulledWhenTheNextOneHasCome) {
  LocalMapper mapper = make();
  mapper.process(packet(at(0)));
  mapper.process(packet(at(1)));
  const auto moved_from = [&](KeyframeId id) {
    const Rigid3 step = estimates[static_cast<size_t>(id)] * estimates.back().inverse();
    return std::make_shared<const KeyframeMotion>(KeyframeMotion{id, {step, false, 1e-6 * Matrix6d::Identity()}});
  };
  KeyframePacket dark = packet(at(2));
  dark.motion = moved_from(1);
  dark.points.assign(dark.points.size(), kNoPoint);
  dark.new_points.clear();
  MapView view = mapper.process(dark);
  EXPECT_NE(view->live_keyframe(2), nullptr) << "the camera is there";
  KeyframePacket next = packet(at(3));
  next.motion = moved_from(2);
  view = mapper.process(next);
  EXPECT_EQ(view->live_keyframe(2), nullptr);
  ASSERT_NE(view->keyframe(3)->motion, nullptr);
  EXPECT_EQ(view->keyframe(3)->motion->previous, 1);
  EXPECT_LT(distance_between(view->cam_from_world(2), at(2)), 1e-3) << "its frames keep their place";
}

TEST_F(Mapping, ViewsOfTheirOwnAreNotCulled) {
  LocalMapper mapper = make();
  MapView view;
  for (int k = 0; k < 4; ++k) view = mapper.process(packet(TestScene::camera_at({0.5 * k, 0, 0}, {0, 0.3 * k, 0})));
  EXPECT_EQ(mapper.report().keyframes_culled, 0);
  EXPECT_EQ(view->live_keyframe_count(), 4);
}

TEST_F(Mapping, AKeyframeMayHangOnACulledOne) {
  LocalMapper mapper = make();
  for (int k = 0; k < 8; ++k) mapper.process(packet(TestScene::camera_at({0.01 * k, 0, 0})));
  KeyframeId culled = kNoKeyframe;
  for (KeyframeId k = 1; k < 8; ++k)
    if (mapper.map().keyframe(k)->culled) culled = k;
  ASSERT_NE(culled, kNoKeyframe);
  KeyframePacket late = packet(TestScene::camera_at({0.1, 0, 0}));
  late.reference = culled;  // tracking did not know yet
  late.cam_from_reference = TestScene::camera_at({0.1, 0, 0}) * estimates[static_cast<size_t>(culled)].inverse();
  const MapView view = mapper.process(late);
  EXPECT_LT(distance_between(view->cam_from_world(late.id), TestScene::camera_at({0.1, 0, 0})), 1e-3);
  EXPECT_NE(view->live_keyframe(view->keyframe(late.id)->parent), nullptr);
}

TEST_F(Mapping, MotionsTieNothingBetweenMapsThatAreNotJoined) {
  const auto motion_from = [](KeyframeId id) {
    return std::make_shared<const KeyframeMotion>(KeyframeMotion{id, {{}, false, Matrix6d::Identity()}});
  };
  LocalMapper mapper = make();
  mapper.process(packet(at(0)));
  const auto nothing_known = [](int) { return false; };
  KeyframePacket other = packet(at(1), at(1), {}, nothing_known);
  other.reference = kNoKeyframe;  // a map of its own
  other.cam_from_reference = at(1);
  mapper.process(other);
  KeyframePacket found = packet(at(2), at(2), {}, nothing_known);
  found.motion = motion_from(0);  // the way here was told, and led into the other map
  mapper.process(found);
  EXPECT_EQ(mapper.map().keyframe(2)->motion, nullptr);
  KeyframePacket next = packet(at(3), at(3), {}, nothing_known);
  next.motion = motion_from(2);
  mapper.process(next);
  EXPECT_NE(mapper.map().keyframe(3)->motion, nullptr);
}

TEST_F(Mapping, AKeyframeThatNothingTiesToTheMapIsAsUncertainAsWhatItHangsOn) {
  LocalMapper mapper = make();
  mapper.process(packet(at(0)));
  mapper.process(packet(at(1), {.pixel_noise = 0.5, .depth_noise = 0.01}));
  const Matrix6d known = mapper.map().keyframe(1)->covariance;
  ASSERT_GT(known.trace(), 0);
  const KeyframePacket apart = packet(at(2), at(2), {}, [](int) { return false; });
  const MapView view = mapper.process(apart);
  const Matrix6d expected = carried(apart.cam_from_reference, known);
  EXPECT_LT((view->keyframe(2)->covariance - expected).norm(), 1e-6 * expected.norm());
}

TEST_F(Mapping, RetractedPointsLeaveTheMap) {
  LocalMapper mapper = make();
  const MapView first = mapper.process(packet(at(0)));
  const auto points = first->live_points();
  KeyframePacket second = packet(at(1));
  second.retracted = {points[4]};
  MapView view = mapper.process(second);
  EXPECT_EQ(view->point(points[4]), nullptr);
  EXPECT_EQ(mapper.report().points_retracted, 1);
  KeyframePacket report;  // no keyframe, only what tracking has to say
  report.retracted = {points[5], points[4]};
  report.visibility = {{points[6], 3, 2}};
  const int visible = view->point(points[6])->visible, found = view->point(points[6])->found;
  view = mapper.process(report);
  EXPECT_EQ(view->point(points[5]), nullptr);
  EXPECT_EQ(view->point(points[6])->visible, visible + 3);
  EXPECT_EQ(view->point(points[6])->found, found + 2);
  EXPECT_EQ(view->live_keyframe_count(), 2);
  EXPECT_EQ(mapper.report().points_retracted, 2);
}

TEST_F(Mapping, TheSamePacketsGiveTheSameMap) {
  std::vector<KeyframePacket> packets;
  for (int k = 0; k < 6; ++k)
    packets.push_back(packet(at(k), {.pixel_noise = 0.7,
                                     .depth_noise = 0.01,
                                     .depth_share = 0.7,
                                     .flipped_bits = 15,
                                     .clutter = 100,
                                     .seed = static_cast<uint64_t>(k) + 1}));
  LocalMapper a = make(), b = make();
  MapView last_a, last_b;
  for (const KeyframePacket& p : packets) {
    last_a = a.process(p);
    last_b = b.process(p);
  }
  ASSERT_EQ(last_a->live_points(), last_b->live_points());
  for (PointId id : last_a->live_points()) EXPECT_EQ(last_a->point(id)->position, last_b->point(id)->position);
  for (KeyframeId k = 0; k < 6; ++k)
    EXPECT_EQ(last_a->cam_from_world(k).translation, last_b->cam_from_world(k).translation);
}

TEST(RefreshPoint, TakesTheDescriptorNearestToTheOthers) {
  // Four views of one point: the second's descriptor is 4 bits from each of the others, these are 8 bits apart.
  Map map;
  const std::vector<Descriptor> seen = {{0x0F, 0, 0, 0}, {0, 0, 0, 0}, {0xF0, 0, 0, 0}, {0xF00, 0, 0, 0}};
  const std::vector<uint8_t> octave = {0, 2, 1, 3};
  const std::vector<double> camera_x = {-1, 0, 1, 0};
  MapPoint p;
  p.id = make_point_id(0, 0);
  p.position = {0, 0, 2};
  for (int k = 0; k < 4; ++k) {
    auto features = std::make_shared<RgbdFeatures>();
    features->keypoints.resize(1);
    features->keypoints[0].octave = octave[static_cast<size_t>(k)];
    features->descriptors = {seen[static_cast<size_t>(k)]};
    add_view(map, {features, {0}}, TestScene::camera_at({camera_x[static_cast<size_t>(k)], 0, 0}));
    if (k == 0) map.add_point(p);
    map.observe(p.id, k, 0);
  }
  refresh_point(map, p.id, 1.2);
  const MapPoint& refreshed = *map.point(p.id);
  EXPECT_EQ(refreshed.descriptor, seen[1]);
  EXPECT_FLOAT_EQ(refreshed.reference_distance, 2);
  EXPECT_FLOAT_EQ(refreshed.reference_scale, 1.44F);
  EXPECT_LT((refreshed.normal - Eigen::Vector3f(0, 0, -1)).norm(), 1e-6F) << "the sides cancel";
}

}  // namespace
}  // namespace dkb
