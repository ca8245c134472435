// SPDX-License-Identifier: Apache-2.0
#include "dkb/mapping/local_bundle_adjustment.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "dkb/geometry/motion_model.h"
#include "dkb/mapping/test_map.h"
#include "dkb/util/errors.h"
#include "dkb/util/quantile.h"

namespace dkb {
namespace {

class LocalBa : public ::testing::Test {
 protected:
  // `keyframes` views 8 cm apart. Poses but the first and all points are off by some centimetres.
  void build(int keyframes, const ViewOptions& options, double pose_error, double point_error) {
    Random random(4);
    const auto noise = [&](double sigma) {
      return Eigen::Vector3d{sigma * random.normal(), sigma * random.normal(), sigma * random.normal()};
    };
    std::vector<Rigid3> start;
    for (int k = 0; k < keyframes; ++k) {
      truth.push_back(TestScene::camera_at({0.08 * k, 0.02 * (k % 3), 0.03 * (k % 2)}, {0, 0.02 * k, 0}));
      ViewOptions o = options;
      o.seed = static_cast<uint64_t>(k) + 1;
      views.push_back(scene.look(truth.back(), o));
      Vector6d error;
      error << noise(pose_error), noise(pose_error);
      start.push_back(k == 0 ? truth.back() : rigid3_from_tangent(error) * truth.back());
    }
    SceneMap made(scene, views, start,
                  [&](int i) { return Eigen::Vector3d(scene.points[static_cast<size_t>(i)] + noise(point_error)); });
    map = std::move(made.map);
    id_of = std::move(made.id_of);
  }
  std::vector<PointId> adjust(KeyframeId newest, const LocalBaOptions& options = {}) {
    SensorNoise noise;
    noise.pixel_sigma = 1.5;  // the test scene's corners blur with their level's scale
    return local_bundle_adjustment(map, newest, scene.optics(noise), options);
  }
  double worst_camera() const {
    double worst = 0;
    for (size_t k = 0; k < truth.size(); ++k)
      worst = std::max(worst, distance_between(map.keyframe(static_cast<KeyframeId>(k))->cam_from_world, truth[k]));
    return worst;
  }
  // [m] median over the points that at least three keyframes see
  double median_point() const {
    std::vector<double> errors;
    for (size_t i = 0; i < id_of.size(); ++i)
      if (const MapPoint* p = map.point(id_of[i]))
        if (p->observations.size() >= 3) errors.push_back((p->position - scene.points[i]).norm());
    return upper_median(errors);
  }

  TestScene scene{400};
  std::vector<Rigid3> truth;
  std::vector<View> views;
  Map map;
  std::vector<PointId> id_of;
};

TEST_F(LocalBa, APerturbedMapReturnsToTheTruth) {
  build(6, {}, 0.01, 0.02);
  const double before = median_point();
  LocalBaOptions options;
  options.weighted = false;  // with weights, what does not fit at the start is left out
  adjust(5, options);
  EXPECT_LT(worst_camera(), 2e-4);
  EXPECT_LT(median_point(), 1e-3);
  EXPECT_GT(before, 0.02);
}

// In the dark only a motion joins it to the keyframe before, whose error it shares.
TEST_F(LocalBa, AKeyframeHeldByAMotionAloneIsAsUncertainAsWhatItHangsOn) {
  build(2, {}, 0, 0);
  const Matrix6d before = axis_covariance(0.2, 0.02), joint = axis_covariance(0.03, 0.004);
  map.set_covariance(1, before);
  Keyframe dark;
  dark.id = 2;
  dark.features = std::make_shared<RgbdFeatures>();
  dark.cam_from_world = map.keyframe(1)->cam_from_world;
  dark.parent = 1;
  dark.motion = std::make_shared<const KeyframeMotion>(KeyframeMotion{1, {Rigid3(), false, joint}});
  map.add_keyframe(std::move(dark));
  adjust(2);
  const Matrix6d error = map.keyframe(2)->covariance - before - joint;
  EXPECT_LT(error.cwiseAbs().maxCoeff(), 1e-3 * before.cwiseAbs().maxCoeff());
}

TEST_F(LocalBa, NoiseIsAveragedOut) {
  build(8, {.pixel_noise = 0.5, .depth_noise = 0.01, .depth_share = 0.7}, 0.002, 0.005);
  adjust(7);
  EXPECT_LT(worst_camera(), 0.006);
  EXPECT_LT(median_point(), 0.012);
}

TEST_F(LocalBa, TheFirstKeyframeOfTheMapNeverMoves) {
  build(5, {.pixel_noise = 0.5}, 0.01, 0.02);
  adjust(4);
  EXPECT_EQ(map.keyframe(0)->cam_from_world.translation, truth[0].translation);
  EXPECT_EQ(map.keyframe(0)->cam_from_world.rotation.coeffs(), truth[0].rotation.coeffs());
}

TEST_F(LocalBa, KeyframesOutsideTheWindowHoldItInPlace) {
  build(8, {.pixel_noise = 0.3}, 0.005, 0.02);
  LocalBaOptions options;
  options.free_keyframes = 3;
  std::vector<Rigid3> before;
  for (KeyframeId k = 0; k < 8; ++k) before.push_back(map.keyframe(k)->cam_from_world);
  adjust(7, options);
  int moved = 0;
  for (size_t k = 0; k < 8; ++k)
    moved += map.keyframe(static_cast<KeyframeId>(k))->cam_from_world.translation != before[k].translation;
  EXPECT_EQ(moved, 3);
  EXPECT_NE(map.keyframe(7)->cam_from_world.translation, before[7].translation);
}

TEST_F(LocalBa, AMotionHoldsAKeyframeThatSharesNoPointWithTheRest) {
  build(4, {}, 0.01, 0.01);
  const Map rest = map;
  const Rigid3 truth_of_last = TestScene::camera_at({0.3, 0, 0}, {0, 0.1, 0});
  const View view = scene.look(truth_of_last, {});
  const Rigid3 true_step = truth_of_last * map.keyframe(3)->cam_from_world.inverse();
  Vector6d error;
  error << 0.1, 0, 0, 0, 0.05, 0;
  // How far off the step to a last keyframe is after adjustment, which sees five points that nobody else does.
  const auto error_of_step = [&](std::shared_ptr<const KeyframeMotion> motion) {
    map = rest;
    Keyframe k;
    k.id = 4;
    k.features = view.features;
    k.points.assign(view.features->size(), kNoPoint);
    k.cam_from_world = rigid3_from_tangent(error) * truth_of_last;
    k.parent = 3;
    k.motion = std::move(motion);
    const Rigid3 world_from_cam = k.cam_from_world.inverse();
    map.add_keyframe(std::move(k));
    for (int f = 0; f < 5; ++f) {
      MapPoint p;
      p.id = make_point_id(4, f);
      const Keypoint& seen = view.features->keypoints[static_cast<size_t>(f)];
      p.position = world_from_cam * scene.camera.unproject(seen.pixel.cast<double>(), seen.depth);
      map.add_point(std::move(p));
      map.observe(make_point_id(4, f), 4, f);
    }
    EXPECT_EQ(adjust(4).size(), 5U);
    return distance_between(map.keyframe(4)->cam_from_world * map.keyframe(3)->cam_from_world.inverse(), true_step);
  };
  EXPECT_GT(error_of_step(nullptr), 0.09);
  const KeyframeMotion known{3, {true_step.inverse(), false, 1e-6 * Matrix6d::Identity()}};
  EXPECT_LT(error_of_step(std::make_shared<const KeyframeMotion>(known)), 1e-4);
}

TEST_F(LocalBa, NoMoreFixedKeyframesThanAskedFor) {
  build(8, {}, 0.005, 0.02);
  LocalBaOptions options;
  options.free_keyframes = 2;
  options.fixed_keyframes = 3;
  const KeyframeId other = map.keyframe(7)->covisible.front().keyframe;
  std::vector<Covisible> around = map.observers_of(map.points_of({other, 7}));
  std::erase_if(around, [&](const Covisible& c) { return c.keyframe == 7 || c.keyframe == other; });
  // How keyframe 7 is adjusted after the one that sees so many-th most points was moved.
  const Map before = map;
  const auto adjusted = [&](size_t place) {
    map = before;
    map.set_pose(around[place].keyframe, Rigid3());
    adjust(7, options);
    return Eigen::Vector3d(map.keyframe(7)->cam_from_world.translation);
  };
  ASSERT_EQ(around.size(), 6U);
  EXPECT_EQ(adjusted(3), adjusted(4));
  EXPECT_EQ(adjusted(3), adjusted(5));
  EXPECT_NE(adjusted(3), adjusted(2));
}

TEST_F(LocalBa, OutlierObservationsAreForgotten) {
  build(6, {.pixel_noise = 0.3, .misplaced = 0.05}, 0.003, 0.01);
  // Which observations are wrong, by the truth.
  struct Seen {
    PointId point;
    KeyframeId keyframe;
    bool wrong;
  };
  std::vector<Seen> seen;
  for (size_t k = 0; k < views.size(); ++k)
    for (size_t f = 0; f < views[k].shows.size(); ++f) {
      const auto i = static_cast<size_t>(views[k].shows[f]);
      const Eigen::Vector2d at = scene.camera.project(truth[k] * scene.points[i]);
      const bool wrong = (at - views[k].features->keypoints[f].pixel.cast<double>()).norm() > 15;
      if (map.point(id_of[i])->observations.size() >= 4) seen.push_back({id_of[i], static_cast<KeyframeId>(k), wrong});
    }
  adjust(5);
  int wrong = 0, wrong_kept = 0, right = 0, right_lost = 0;
  for (const Seen& s : seen) {
    const MapPoint* p = map.point(s.point);
    const bool kept = p != nullptr && std::any_of(p->observations.begin(), p->observations.end(),
                                                  [&](const Observation& o) { return o.keyframe == s.keyframe; });
    (s.wrong ? wrong : right) += 1;
    wrong_kept += s.wrong && kept;
    right_lost += !s.wrong && !kept;
  }
  EXPECT_GT(wrong, 30);
  EXPECT_LE(wrong_kept, wrong / 20);
  EXPECT_LE(right_lost, right / 20);
  EXPECT_LT(worst_camera(), 0.01);
}

TEST_F(LocalBa, MovedPointsAreReportedByIncreasingId) {
  build(4, {}, 0.0003, 0.0005);
  const std::vector<PointId> moved = adjust(3);
  EXPECT_EQ(moved, map.live_points());
  EXPECT_TRUE(std::is_sorted(moved.begin(), moved.end()));
}

TEST_F(LocalBa, TheSameMapGivesTheSameBits) {
  build(5, {.pixel_noise = 0.5, .misplaced = 0.02}, 0.01, 0.02);
  const Map copy = map;
  adjust(4);
  const Map first = map;
  map = copy;
  adjust(4);
  for (KeyframeId k = 0; k < 5; ++k)
    EXPECT_EQ(first.keyframe(k)->cam_from_world.translation, map.keyframe(k)->cam_from_world.translation);
  EXPECT_EQ(first.live_points(), map.live_points());
}

TEST_F(LocalBa, WeightsAreAtWorkOnlyWhenAskedFor) {
  build(8, {.pixel_noise = 1}, 0.005, 0.01);
  const Map before = map;
  const auto adjusted = [&](bool weighted, double edge_weight) {
    map = before;
    LocalBaOptions options;
    options.weighted = weighted;
    options.weights.adaptive = false;
    options.weights.edge_weight = edge_weight;
    adjust(7, options);
    return Eigen::Vector3d(map.keyframe(7)->cam_from_world.translation);
  };
  const Eigen::Vector3d plain = adjusted(false, 1.5), light = adjusted(true, 1.5), heavy = adjusted(true, 5);
  EXPECT_EQ(plain, adjusted(false, 5));
  EXPECT_NE(plain, light);
  EXPECT_NE(light, heavy);
}

TEST_F(LocalBa, KeyframesAreKnownByWhatHoldsThemAndByTheMeasurements) {
  build(6, {.pixel_noise = 0.5}, 0.01, 0.02);
  for (int i = 0; i < 3; ++i) adjust(5);  // until nothing changes
  const Matrix6d by_first = map.keyframe(5)->covariance;
  EXPECT_TRUE(map.keyframe(0)->covariance.isZero()) << "it is the world";
  EXPECT_GT(by_first.llt().info() == Eigen::Success ? by_first.trace() : 0, 0);
  EXPECT_LT(std::sqrt(by_first.topLeftCorner<3, 3>().trace()), 0.02);

  // What holds the window is off by a millimetre sideways: so is the newest.
  Matrix6d off = Matrix6d::Zero();
  off(1, 1) = 1e-6;
  map.set_covariance(0, off);
  adjust(5);
  const double more = map.keyframe(5)->covariance(1, 1) - by_first(1, 1);
  EXPECT_NEAR(more, 1e-6, 0.3e-6);
}

}  // namespace
}  // namespace dkb
