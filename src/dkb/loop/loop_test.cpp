// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/geometry/motion_model.h"
#include "dkb/loop/global_adjustment.h"
#include "dkb/loop/loop_closer.h"
#include "dkb/loop/loop_test_world.h"
#include "dkb/mapping/local_mapper.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

using test::OdometryWorld;
using test::RoundTrip;

LocalMapper mapper_of(const OdometryWorld& world, const Map& map) {
  return LocalMapper(world.scene.optics(), {}, Map(map));
}

double worst_error(const OdometryWorld& world, const Map& map) {
  double worst = 0;
  for (KeyframeId k = 0; k < map.keyframe_count(); ++k) worst = std::max(worst, world.error(map, k));
  return worst;
}

TEST(LoopDetection, FindsNothingWhileEverythingIsNew) {
  RoundTrip world;
  for (int k = 0; k < RoundTrip::kRound - 10; ++k) {
    world.go(1);
    EXPECT_FALSE(find_loop(world.map, k, world.optics(), {}, 1)) << "keyframe " << k;
  }
}

TEST(LoopDetection, FindsTheStartAgainAfterARound) {
  RoundTrip world;
  world.go(RoundTrip::kRound + 2);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const auto found = find_loop(world.map, last, world.optics(), {}, 1);
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->merge);
  EXPECT_EQ(found->support.front().keyframe, last);
  EXPECT_GE(found->support.size(), 3U);
  EXPECT_LE(found->far_area.front(), 6);
  const Rigid3 truth = world.truths[static_cast<size_t>(last)];
  EXPECT_LT(distance_between(found->support.front().fit.cam_from_world, truth), 0.05) << "in the world of the start";
  EXPECT_GT(world.error(world.map, last), 0.1) << "where drift has brought it";
}

TEST(LoopCorrection, ClosesTheRoundAndAdjustmentSharpensIt) {
  RoundTrip world;
  world.go(RoundTrip::kRound + 2);
  LocalMapper mapper = mapper_of(world, world.map);
  LoopCloser closer(world.optics(), {}, 1);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const double before = worst_error(world, world.map);
  const auto correction = closer.process(world.map, last);
  ASSERT_TRUE(correction);
  EXPECT_EQ(correction->kind, MapCorrection::Kind::loop);
  const size_t points = world.map.point_count();
  MapView view = mapper.apply(*correction);
  EXPECT_LT(worst_error(world, *view), 0.6 * before);
  EXPECT_LT(world.error(*view, last), 0.05);
  EXPECT_LT(view->point_count(), points) << "points known twice were fused";
  EXPECT_TRUE(std::any_of(view->keyframe(last)->covisible.begin(), view->keyframe(last)->covisible.end(),
                          [](const Covisible& c) { return c.keyframe < 5; }))
      << "the ends are connected now";
  EXPECT_FALSE(find_loop(*view, last, world.optics(), {}, 1)) << "keyframes that are connected make no loop";
  view = mapper.apply(adjust_globally(*view, world.optics(), {}));
  EXPECT_LT(worst_error(world, *view), 0.25 * before);
}

TEST(GlobalAdjustment, OfALargeMapTakesWhatIsAroundTheNewestKeyframeAndHoldsItsBorder) {
  RoundTrip world;
  world.go(RoundTrip::kRound - 4);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const auto whole = adjust_globally(world.map, world.optics(), {});
  EXPECT_EQ(whole.poses.size(), static_cast<size_t>(world.map.live_keyframe_count()));
  const auto part = adjust_globally(world.map, world.optics(), {}, {}, 60);
  EXPECT_EQ(part.poses.size(), whole.poses.size()) << "the others are told that they stay";
  std::vector<KeyframeId> moved;
  for (const MapCorrection::Pose& p : part.poses)
    if ((centre_in_world(p.before) - centre_in_world(p.after)).norm() > 0) moved.push_back(p.keyframe);
  ASSERT_GE(moved.size(), 3U);
  EXPECT_LT(moved.size(), 19U);
  EXPECT_EQ(moved.back(), last);
  EXPECT_EQ(moved.front(), last + 1 - static_cast<KeyframeId>(moved.size()));
  Map after = world.map;
  move_map(after, part);
  EXPECT_EQ(after.keyframe(0), world.map.keyframe(0)) << "what stays is not copied";
  int of_the_border = 0;
  for (const MapCorrection::Position& p : part.positions) {
    of_the_border += birth_keyframe(p.point) < moved.front() && p.before != p.after;
    EXPECT_LT((after.point(p.point)->position - p.after).norm(), 1e-9) << "born at " << birth_keyframe(p.point);
  }
  EXPECT_GT(of_the_border, 0);
}

// Keyframes that take no part hold the point where it is, against one that does.
TEST(GlobalAdjustment, DoesNotMoveAPointOntoTheOnlyOneOfItsObserversThatTakesPart) {
  RoundTrip world;
  world.go(RoundTrip::kRound - 4);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const PointId held = world.map.live_points()[0];
  const auto& points = world.map.keyframe(last)->points;
  const auto free = std::find(points.begin(), points.end(), kNoPoint);
  ASSERT_NE(free, points.end());
  ASSERT_GE(world.map.point(held)->observations.size(), 2U);
  world.map.observe(held, last, static_cast<int>(free - points.begin()));
  for (const auto& p : adjust_globally(world.map, world.optics(), {}, {last}, 60).positions) EXPECT_NE(p.point, held);
}

// Two loops were closed at once: the keyframes that there is room for are those around both.
TEST(GlobalAdjustment, OfALargeMapTakesWhatIsAroundEachOfTheGivenKeyframes) {
  RoundTrip world;
  world.go(RoundTrip::kRound - 4);
  std::vector<KeyframeId> moved;
  for (const MapCorrection::Pose& p : adjust_globally(world.map, world.optics(), {}, {12, 36}, 200).poses)
    if (p.before.translation != p.after.translation) moved.push_back(p.keyframe);
  const auto near = [&](KeyframeId k) {
    return std::count_if(moved.begin(), moved.end(), [k](KeyframeId m) { return std::abs(m - k) < 6; });
  };
  EXPECT_GE(near(12), 3);
  EXPECT_GE(near(36), 3);
  EXPECT_LT(moved.size(), 36U);
}

// A motion ties the newest keyframe to one that takes no part.
TEST(GlobalAdjustment, HoldsWhoeverAMotionTiesToWhatTakesNoPart) {
  RoundTrip world;
  world.go(RoundTrip::kRound - 4);
  const KeyframeId last = world.map.keyframe_count() - 1;
  std::vector<Keyframe> keyframes;
  std::vector<MapPoint> points;
  for (KeyframeId k = 0; k <= last; ++k) keyframes.push_back(*world.map.keyframe(k));
  for (PointId p : world.map.live_points()) points.push_back(*world.map.point(p));
  const Rigid3 back = world.map.keyframe(0)->cam_from_world * world.map.keyframe(last)->cam_from_world.inverse();
  keyframes.back().motion =
      std::make_shared<const KeyframeMotion>(KeyframeMotion{0, {back, false, Matrix6d::Identity()}});
  const Map map = Map::restore(std::move(keyframes), std::move(points), {});
  size_t neighbours = map.keyframe(last)->covisible.size();
  for (const Covisible& c : map.keyframe(last)->covisible) neighbours += map.keyframe(c.keyframe)->covisible.size();
  for (const MapCorrection::Pose& p : adjust_globally(map, world.optics(), {}, {}, neighbours).poses)
    if (p.keyframe == last) {
      EXPECT_EQ(p.before.translation, p.after.translation);
    }
}

// What the observations of the snapshot and of local adjustment since have in common must not count twice.
TEST(GlobalAdjustment, TakesThePlaceOfWhatLocalAdjustmentDidMeanwhile) {
  RoundTrip world;
  world.go(RoundTrip::kRound + 2);
  LocalMapper mapper = mapper_of(world, world.map);
  LoopCloser closer(world.optics(), {}, 1);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const auto loop = closer.process(world.map, last);
  ASSERT_TRUE(loop);
  const MapView snapshot = mapper.apply(*loop);
  MapCorrection adjustment = adjust_globally(*snapshot, world.optics(), {});
  Map meanwhile = *snapshot;
  local_bundle_adjustment(meanwhile, last, world.optics(), {});
  const auto mean_chi2_after = [&](const MapCorrection& correction) {
    Map map = meanwhile;
    move_map(map, correction);
    double sum = 0;
    int count = 0;
    for (PointId p : map.live_points())
      for (const Observation& o : map.point(p)->observations) {
        const Keyframe& k = *map.keyframe(o.keyframe);
        const Keypoint& seen = k.features->keypoints[static_cast<size_t>(o.feature)];
        const Eigen::Vector3d in_cam = k.cam_from_world * map.point(p)->position;
        const double chi2 = (world.optics().camera.project(in_cam) - seen.pixel.cast<double>()).squaredNorm() /
                            world.optics().corner_variance(seen);
        sum += std::min(chi2, kChi2TwoDof95);
        ++count;
      }
    return sum / count;
  };
  const double in_its_place = mean_chi2_after(adjustment);
  adjustment.kind = MapCorrection::Kind::loop;  // which is applied on top
  EXPECT_LT(in_its_place, 0.7 * mean_chi2_after(adjustment));
}

// Two parts of the way, in the dark between which a motion alone holds them together, and a map beside them.
TEST(GlobalAdjustment, TakesWhatAMotionJoinsAndNoMapThatIsNotJoined) {
  RoundTrip world;
  world.go(12);
  const KeyframeId last = 23, other = 24;
  for (KeyframeId k = 12; k <= last; ++k) {
    const Rigid3 truth = RoundTrip::truth_at(k + 15);
    world.add(truth, truth);
  }
  for (KeyframeId k = other; k < other + 5; ++k) world.add(RoundTrip::truth_at(k), RoundTrip::truth_at(k), k == other);
  std::vector<Keyframe> keyframes;
  std::vector<MapPoint> points;
  for (KeyframeId k = 0; k < world.map.keyframe_count(); ++k) keyframes.push_back(*world.map.keyframe(k));
  for (PointId p : world.map.live_points()) points.push_back(*world.map.point(p));
  const Rigid3 back = world.map.keyframe(11)->cam_from_world * world.map.keyframe(12)->cam_from_world.inverse();
  keyframes[12].motion =
      std::make_shared<const KeyframeMotion>(KeyframeMotion{11, {back, false, 1e-4 * Matrix6d::Identity()}});
  const Map map = Map::restore(std::move(keyframes), std::move(points), {});
  const auto moved = [&](const std::vector<KeyframeId>& around, size_t most_neighbours) {
    std::vector<KeyframeId> ids;
    for (const auto& p : adjust_globally(map, world.optics(), {}, around, most_neighbours).poses)
      if (p.before.translation != p.after.translation) ids.push_back(p.keyframe);
    return ids;
  };
  size_t neighbours = 0;
  for (KeyframeId k = 0; k <= last; ++k) neighbours += map.keyframe(k)->covisible.size();
  const std::vector<KeyframeId> both = moved({last}, neighbours);
  EXPECT_EQ(both.size(), static_cast<size_t>(last)) << "all but the first";
  EXPECT_EQ(both.back(), last);
  EXPECT_EQ(moved({last}, kMostNeighbours), both);
  EXPECT_EQ(moved({}, kMostNeighbours).size(), both.size() + 4) << "each map";
  EXPECT_EQ(moved({}, neighbours - 10).back(), other + 4) << "the newest first";
}

// Keyframe `last` sees the first one's area again, and its pose is off by `drift` in its own axes.
LoopFinding found_at_the_start(const Map& map, KeyframeId last, const Eigen::Vector3d& drift) {
  LoopFinding finding;
  finding.far_area = {0};
  finding.support.emplace_back().keyframe = last;
  PlaceFit& fit = finding.support.back().fit;
  fit.cam_from_world = map.keyframe(last)->cam_from_world;
  fit.cam_from_world.translation += drift;
  fit.inliers = 400;
  return finding;
}

// Thirty keyframes half a metre apart, each of which shares 20 points with the next. The way comes back beside keyframe
// 2 at keyframe 20, where a loop was closed once: they share 20 points as well.
TEST(LoopCorrection, ASeamHoldsWhenTheNextLoopIsClosed) {
  constexpr int kShared = 20;
  Map map;
  const auto see = [&](KeyframeId first, int feature, KeyframeId then, int there) {
    for (int i = 0; i < kShared; ++i) {
      MapPoint p;
      p.id = make_point_id(first, feature + i);
      map.add_point(p);
      map.observe(p.id, first, feature + i);
      map.observe(p.id, then, there + i);
    }
  };
  for (KeyframeId id = 0; id < 30; ++id) {
    Keyframe k;
    k.id = id;
    k.parent = id - 1;
    auto features = std::make_shared<RgbdFeatures>();
    features->keypoints.resize(3 * kShared);
    features->descriptors.resize(3 * kShared);
    k.features = features;
    k.points.assign(3 * kShared, kNoPoint);
    k.cam_from_world = TestScene::camera_at({0.5 * (id <= 11 ? id : 22 - id), 0, 0});
    map.add_keyframe(std::move(k));
    if (id > 0) see(id - 1, kShared, id, 0);
    if (id == 20) see(2, 2 * kShared, 20, 2 * kShared);
    map.update_covisibility(id, 15);
  }
  const double drift = 0.3;
  Map moved = map;
  move_map(moved, correct_loop(map, found_at_the_start(map, 29, {0, 0, drift})));
  const auto bent = [&](KeyframeId a, KeyframeId b) {
    const Rigid3 before = map.cam_from_world(b) * map.cam_from_world(a).inverse();
    const Rigid3 after = moved.cam_from_world(b) * moved.cam_from_world(a).inverse();
    return distance_between(before, after);
  };
  EXPECT_GT(bent(0, 29), 0.8 * drift);
  EXPECT_LT(bent(2, 20), 0.1 * drift);
}

TEST(LoopCorrection, KeyframesMadeMeanwhileFollowTheirParents) {
  RoundTrip world;
  world.go(RoundTrip::kRound + 2);
  LoopCloser closer(world.optics(), {}, 1);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const auto correction = closer.process(*world.map.snapshot(), last);
  ASSERT_TRUE(correction);
  world.go(2);
  world.map.cull_keyframe(last - 3);
  Map moved = world.map;
  move_map(moved, *correction);
  for (KeyframeId k : {last + 1, last + 2}) {
    const KeyframeId parent = world.map.keyframe(k)->parent;
    const Rigid3 before = world.map.cam_from_world(k) * world.map.cam_from_world(parent).inverse();
    const Rigid3 after = moved.cam_from_world(k) * moved.cam_from_world(parent).inverse();
    EXPECT_LT((before * after.inverse()).translation.norm(), 1e-9);
    EXPECT_LT(world.error(moved, k), 0.3 * world.error(world.map, k));
  }
  const Keyframe& newest = *world.map.keyframe(last + 2);
  for (PointId id : newest.points) {
    if (id == kNoPoint || birth_keyframe(id) != last + 2) continue;
    const Eigen::Vector3d before = newest.cam_from_world * world.map.point(id)->position;
    EXPECT_LT((moved.cam_from_world(last + 2) * moved.point(id)->position - before).norm(), 1e-9);
  }
  EXPECT_EQ(moved.cam_from_world(0).translation, world.map.cam_from_world(0).translation) << "the first one stays";
}

// How many pairs of keyframes share so many points without being covisible.
int pairs_left_out(const Map& map, int min_shared_points) {
  int left_out = 0;
  for (KeyframeId id : map.live_keyframes())
    for (const Covisible& c : map.observers_of(map.points_of({id})))
      left_out += c.keyframe > id && c.shared_points >= min_shared_points &&
                  points_shared_with(c.keyframe, map.keyframe(id)->covisible) == 0;
  return left_out;
}

// What was fused at the seam is seen by keyframes beside those that found the loop, and by those made meanwhile.
TEST(LoopCorrection, WhoeverSharesPointsAtTheSeamIsCovisibleAfterwards) {
  RoundTrip world;
  world.go(RoundTrip::kRound + 6);
  LoopCloser closer(world.optics(), {}, 1);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const auto correction = closer.process(*world.map.snapshot(), last);
  ASSERT_TRUE(correction);
  world.go(2);
  ASSERT_EQ(pairs_left_out(world.map, 15), 0);
  LocalMapper mapper = mapper_of(world, world.map);
  const MapView view = mapper.apply(*correction);
  EXPECT_EQ(pairs_left_out(*view, 15), 0);
  for (KeyframeId k : {last + 1, last + 2})
    EXPECT_TRUE(std::any_of(view->keyframe(k)->covisible.begin(), view->keyframe(k)->covisible.end(),
                            [](const Covisible& c) { return c.keyframe < 12; }))
        << "keyframe " << k;
}

TEST(LoopCorrection, WherePointsTieNothingTheWayBendsWhereTheMotionIsKnownWorst) {
  // Ten keyframes, half a metre apart, that share no point. The motion to the sixth is known to 10 cm, to others to 3
  // mm.
  Map map;
  for (KeyframeId id = 0; id < 10; ++id) {
    Keyframe k;
    k.id = id;
    k.parent = id - 1;
    k.features = std::make_shared<const RgbdFeatures>();
    k.cam_from_world.translation = {0.5 * id, 0, 0};
    const double sd = id == 6 ? 0.1 : 0.003;
    if (id > 0)
      k.motion = std::make_shared<const KeyframeMotion>(KeyframeMotion{
          id - 1, {Rigid3(Eigen::Quaterniond::Identity(), {-0.5, 0, 0}), false, sd * sd * Matrix6d::Identity()}});
    map.add_keyframe(std::move(k));
  }
  const Eigen::Vector3d drift(0.05, 0.2, 0);
  const MapCorrection correction = correct_loop(map, found_at_the_start(map, 9, drift));
  ASSERT_EQ(correction.poses.size(), 10U);
  const auto moved = [&](size_t k) -> Eigen::Vector3d {
    return centre_in_world(correction.poses[k].after) - centre_in_world(correction.poses[k].before);
  };
  EXPECT_LT(moved(5).norm(), 0.01);
  EXPECT_GT(moved(6).norm(), 0.8 * moved(9).norm());
  EXPECT_GT(moved(9).norm(), 0.5 * drift.norm());
}

// Two rooms with the same pictures, and a corridor with others between them.
struct Twins : OdometryWorld {
  static constexpr double kPitch = 7;
  // `apart`: what follows after so many keyframes is a map of its own.
  explicit Twins(int apart = -1) : OdometryWorld(1500) {
    Random random(9);
    for (size_t i = 0; i < 500; ++i) {
      scene.points[i] = {random.uniform(-1.5, 2.5), random.uniform(-1.2, 1.2), random.uniform(2.0, 3.0)};
      scene.points[i + 500] = scene.points[i] + Eigen::Vector3d(kPitch, 0, 0);
      scene.descriptors[i + 500] = scene.descriptors[i];
      scene.points[i + 1000] = {random.uniform(2.5, 5.5), random.uniform(-1.2, 1.2), random.uniform(2.0, 3.0)};
    }
    for (int k = 0; k < 31; ++k) {
      const Rigid3 at = TestScene::camera_at({0.3 * k, 0, 0});
      add(at, at, k == apart);
    }
  }
};

TEST(LoopDetection, ALookAlikeRoomIsNotTheSameRoom) {
  const Twins world, without_a_way(18);
  int deceived = 0;
  for (KeyframeId k = 0; k < world.map.keyframe_count(); ++k) {
    EXPECT_FALSE(find_loop(world.map, k, world.optics(), {}, 1)) << "keyframe " << k;
    deceived += find_loop(without_a_way.map, k, world.optics(), {}, 1).has_value();
  }
  EXPECT_GT(deceived, 0) << "by looks alone it would be";
}

// After 200 m any rotation could be explained by the length of the way.
TEST(LoopDetection, ALongWayDoesNotExplainAnyRotation) {
  PathThroughMap path;
  path.length = 200;
  EXPECT_NEAR(drift_bound(path).translation, 0.2 + 0.08 * 200, 1e-9);
  EXPECT_NEAR(drift_bound(path).rotation, 30, 1e-9);
}

TEST(LoopDetection, WaysLeadThroughTheMap) {
  const Twins world;
  const auto paths = paths_through_map(world.map, 30);
  EXPECT_EQ(paths[30].length, 0);
  EXPECT_NEAR(paths[0].length, 9, 1e-6);
  EXPECT_NEAR(paths[20].length, 3, 1e-6);
  EXPECT_EQ(paths[0].position_variance, 0) << "points tie all of it together";
  const auto some = paths_through_map(world.map, 30, {20, 25});
  EXPECT_EQ(some[20].length, paths[20].length);
  EXPECT_EQ(some[25].length, paths[25].length);
  EXPECT_TRUE(std::isinf(some[0].length)) << "nobody asked how far that is";
}

// Where nothing but a motion joins two keyframes, the way is as uncertain as the motion.
TEST(LoopDetection, WaysByMotionAloneAreAsUncertainAsTheMotion) {
  Map map;
  for (KeyframeId k = 0; k < 4; ++k) {
    Keyframe keyframe;
    keyframe.id = k;
    keyframe.features = std::make_shared<RgbdFeatures>();
    keyframe.cam_from_world = TestScene::camera_at({1.0 * k, 0, 0}, {0, 0, 0});
    keyframe.parent = k - 1;
    if (k > 1)
      keyframe.motion = std::make_shared<const KeyframeMotion>(
          KeyframeMotion{k - 1, {Rigid3(), false, axis_covariance(0.1 * k, 0.01 * k)}});
    map.add_keyframe(std::move(keyframe));
  }
  const auto paths = paths_through_map(map, 3);
  EXPECT_NEAR(paths[0].length, 3, 1e-9);
  EXPECT_NEAR(paths[2].position_variance, 3 * 0.09, 1e-12);
  EXPECT_NEAR(paths[1].position_variance, 3 * (0.09 + 0.04), 1e-12);
  EXPECT_NEAR(paths[0].rotation_variance, 3 * (0.0009 + 0.0004), 1e-12) << "of the first step nothing is told";
  EXPECT_NEAR(paths_through_map(map, 0)[3].position_variance, 3 * (0.09 + 0.04), 1e-12);
}

TEST(MapMerge, TheYoungerMapMovesOntoTheOlderAsOnePiece) {
  RoundTrip world;
  world.go(12);
  const Rigid3 other_from_world(rotation_from_vector({0.1, 1.2, -0.3}), {2, -1, 5});
  for (int k = 12; k < 24; ++k) {  // a second map, of a world of its own, that comes round to the first one's start
    const Rigid3 truth = RoundTrip::truth_at(k - 20);
    world.add(truth, truth * other_from_world.inverse(), k == 12);
  }
  ASSERT_EQ(world.map.roots().size(), 2U);
  for (KeyframeId k = 0; k < 12; ++k) world.map.set_covariance(k, 1e-4 * Matrix6d::Identity());
  LoopCloser closer(world.optics(), {}, 1);
  const auto correction = closer.process(world.map, 23);
  ASSERT_TRUE(correction);
  EXPECT_EQ(correction->kind, MapCorrection::Kind::merge);
  LocalMapper mapper = mapper_of(world, world.map);
  const MapView view = mapper.apply(*correction);
  EXPECT_EQ(view->roots(), std::vector<KeyframeId>{0});
  for (KeyframeId k = 12; k < 24; ++k) {  // turns are as uncertain everywhere as at the joint
    const double variance = view->keyframe(k)->covariance.bottomRightCorner<3, 3>().trace();
    EXPECT_GT(variance, 3e-4) << "keyframe " << k;
    EXPECT_LT(variance, 4e-4) << "keyframe " << k;
  }
  for (KeyframeId k = 0; k < 12; ++k)
    EXPECT_EQ(view->cam_from_world(k).translation, world.map.cam_from_world(k).translation) << "the older one stays";
  for (KeyframeId k = 12; k < 24; ++k) EXPECT_LT(world.error(*view, k), 0.05) << "keyframe " << k;
  const Rigid3 before = world.map.cam_from_world(23) * world.map.cam_from_world(13).inverse();
  const Rigid3 after = view->cam_from_world(23) * view->cam_from_world(13).inverse();
  EXPECT_LT((before * after.inverse()).translation.norm(), 1e-9);
}

TEST(MapMerge, MapsThatShareNothingStayApart) {
  RoundTrip world;
  world.go(5);
  for (int k = 5; k < 10; ++k) {
    const Rigid3 truth = RoundTrip::truth_at(k + 15);
    world.add(truth, truth, k == 5);
    EXPECT_FALSE(find_loop(world.map, k, world.optics(), {}, 1));
  }
}

TEST(LoopCloser, TheSameSnapshotsGiveTheSameCorrections) {
  RoundTrip world;
  world.go(RoundTrip::kRound + 2);
  const KeyframeId last = world.map.keyframe_count() - 1;
  const auto a = LoopCloser(world.optics(), {}, 3).process(world.map, last);
  const auto b = LoopCloser(world.optics(), {}, 3).process(*world.map.snapshot(), last);
  ASSERT_TRUE(a && b);
  ASSERT_EQ(a->poses.size(), b->poses.size());
  for (size_t i = 0; i < a->poses.size(); ++i) {
    EXPECT_EQ(a->poses[i].after.translation, b->poses[i].after.translation);
    EXPECT_EQ(a->poses[i].after.rotation.coeffs(), b->poses[i].after.rotation.coeffs());
  }
  EXPECT_EQ(a->same, b->same);
}

}  // namespace
}  // namespace dkb
