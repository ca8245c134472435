// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "dkb/matching/test_scene.h"
#include "dkb/tracking/tracker.h"

namespace dkb {

inline constexpr double kFrameTime = 1.0 / 30;  // [s]

inline constexpr ViewOptions kNoisy{
    .pixel_noise = 0.5, .depth_noise = 0.01, .depth_share = 0.8, .flipped_bits = 20, .clutter = 200, .misplaced = 0.1};

// Features that a view gives, whatever the velocity; tells what it was asked for.
class FakeFeatures final : public FrameFeatures {
 public:
  explicit FakeFeatures(std::shared_ptr<const RgbdFeatures> features) : features_(std::move(features)) {}
  std::shared_ptr<const RgbdFeatures> at(const Vector6d& velocity) const override {
    asked.push_back(velocity);
    return features_;
  }

  mutable std::vector<Vector6d> asked;

 private:
  std::shared_ptr<const RgbdFeatures> features_;
};

// A tracker in a TestScene, with a map that the test publishes to it. For tests of the tracker.
class TrackerTest : public ::testing::Test {
 protected:
  TrackedFrame track(const Rigid3& cam_from_world, ViewOptions options = {}) {
    ++index;
    options.seed = options.seed * 1000 + static_cast<uint64_t>(index);
    view = scene.look(cam_from_world, options);
    if (black) view.features = std::make_shared<RgbdFeatures>();
    return track(FakeFeatures(view.features));
  }
  // The frame `index` with these features.
  TrackedFrame track(const FrameFeatures& features) {
    return tracker.track({.index = index, .timestamp = index * kFrameTime + stalled, .features = features});
  }
  // The first frame and its keyframe.
  KeyframePacket start(const Rigid3& cam_from_world = {}, const ViewOptions& options = {}) {
    TrackedFrame first = track(cam_from_world, options);
    EXPECT_TRUE(first.starts_map);
    first.cam_from_world = cam_from_world;
    return insert(first);
  }
  KeyframePacket insert(const TrackedFrame& frame) {
    keyframe_shows.push_back(view.shows);
    return tracker.make_keyframe(static_cast<KeyframeId>(keyframe_shows.size()) - 1, frame);
  }
  // What mapping would do, without any refinement.
  void work_in(const KeyframePacket& packet) {
    Keyframe k;
    k.id = packet.id;
    k.features = packet.features;
    k.points = packet.points;
    k.parent = packet.reference;
    k.cam_from_world = packet.reference == kNoKeyframe
                           ? packet.cam_from_reference
                           : packet.cam_from_reference * map.cam_from_world(packet.reference);
    const Rigid3 world_from_cam = k.cam_from_world.inverse();
    map.add_keyframe(std::move(k));
    for (const ProvisionalPoint& n : packet.new_points) {
      MapPoint p;
      p.id = n.id;
      p.position = world_from_cam * n.point_in_keyframe;
      p.reference_distance = static_cast<float>(n.point_in_keyframe.norm());
      p.reference_scale = n.scale;
      p.descriptor = n.descriptor;
      map.add_point(p);
      map.observe(n.id, packet.id, birth_feature(n.id));
    }
    map.update_covisibility(packet.id, 1);
  }
  Rigid3 publish() { return tracker.take_view(map.snapshot()); }
  Rigid3 publish(const KeyframePacket& packet) {
    work_in(packet);
    return publish();
  }
  // The scene's point behind a map point, by the keyframe and feature that it is named after.
  int scene_point(PointId id) const {
    return keyframe_shows[static_cast<size_t>(birth_keyframe(id))][static_cast<size_t>(birth_feature(id))];
  }
  // Hand-held: 0.6 m/s to the right, 0.3 rad/s about the vertical axis.
  static Rigid3 on_path(double frames) {
    return TestScene::camera_at({0.02 * frames, 0.005 * frames, 0}, {0, 0.01 * frames, 0});
  }

  double stalled = 0;  // [s] the stamps of all frames from now on are later by it
  TestScene scene{700};
  Tracker tracker{scene.optics(), {}, 1};
  Map map;
  View view;  // of the last frame
  std::vector<std::vector<int>> keyframe_shows;
  FrameIndex index = -1;
  bool black = false;
};

}  // namespace dkb
