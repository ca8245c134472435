// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <vector>

#include "dkb/loop/loop_detector.h"
#include "dkb/mapping/local_mapper.h"
#include "dkb/mapping/test_map.h"

namespace dkb::test {

// A map as odometry alone makes it: poses drift, points hang on the keyframe that first saw them, and a point that was
// out of sight for a while is a new one when it comes back.
class OdometryWorld {
 public:
  explicit OdometryWorld(int points)
      : scene(points), id_of_(static_cast<size_t>(points), kNoPoint), last_seen_(static_cast<size_t>(points), -100) {}

  // A keyframe at `truth` that takes itself to be at `estimate` [cam_from_world both]; `root`: it starts a new map.
  KeyframeId add(const Rigid3& truth, const Rigid3& estimate, bool root = false) {
    constexpr int kForgotten = 4;  // [keyframes] out of sight
    const int k = map.keyframe_count();
    const View view = scene.look(truth, {.pixel_noise = 0.3, .clutter = 30, .seed = static_cast<uint64_t>(k) + 1});
    Keyframe keyframe;
    keyframe.id = k;
    keyframe.frame = 10 * k;
    keyframe.features = view.features;
    keyframe.cam_from_world = estimate;
    keyframe.points.assign(view.features->size(), kNoPoint);
    keyframe.parent = root || k == 0 ? kNoKeyframe : k - 1;
    map.add_keyframe(std::move(keyframe));
    for (size_t f = 0; f < view.shows.size(); ++f) {
      if (view.shows[f] < 0) continue;
      const auto i = static_cast<size_t>(view.shows[f]);
      if (root || k - last_seen_[i] > kForgotten) {
        MapPoint p;
        p.id = id_of_[i] = make_point_id(k, static_cast<int>(f));
        p.position = estimate.inverse() * (truth * scene.points[i]);
        map.add_point(std::move(p));
      }
      last_seen_[i] = k;
      map.observe(id_of_[i], k, static_cast<int>(f));
    }
    for (PointId id : map.keyframe(k)->points)
      if (id != kNoPoint) refresh_point(map, id, TestScene::kScaleFactor);
    map.update_covisibility(k, 15);
    truths.push_back(truth);
    return k;
  }
  Optics optics() const { return scene.optics(); }
  // [m] between where keyframe k is in `m` and where it is in truth; the worlds share their first keyframe.
  double error(const Map& m, KeyframeId k) const {
    return (centre_in_world(m.cam_from_world(k)) - centre_in_world(truths[static_cast<size_t>(k)])).norm();
  }

  TestScene scene;
  Map map;
  std::vector<Rigid3> truths;

 private:
  std::vector<PointId> id_of_;
  std::vector<int> last_seen_;
};

// Round a hall with pictures on its round wall, looking outward: 48 keyframes a round, 3.5 m from the axis. The
// estimate turns a little too much and the depth of the way is a little too long.
struct RoundTrip : OdometryWorld {
  static constexpr int kRound = 48;
  RoundTrip() : OdometryWorld(3600) {
    Random random(5);
    for (Eigen::Vector3d& p : scene.points) {
      const double angle = random.uniform(0, 2 * M_PI), height = random.uniform(-1.5, 1.5);
      p = {6 * std::sin(angle), height, 6 * std::cos(angle)};
    }
  }
  static Rigid3 truth_at(int k) {
    const double angle = 2 * M_PI * k / kRound;
    return TestScene::camera_at({3.5 * std::sin(angle), 0, 3.5 * std::cos(angle)}, {0, angle, 0});
  }
  void go(int keyframes) {
    const Vector6d slip = (Vector6d() << 0.004, 0.001, -0.002, 0.0002, -0.0005, 0.0002).finished();
    for (int i = 0; i < keyframes; ++i) {
      const int k = map.keyframe_count();
      const Rigid3 truth = truth_at(k);
      const Rigid3 estimate =
          k == 0 ? truth
                 : rigid3_from_tangent(slip) * (truth * truths.back().inverse()) * map.keyframe(k - 1)->cam_from_world;
      add(truth, estimate);
    }
  }
};

}  // namespace dkb::test
