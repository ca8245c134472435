// SPDX-License-Identifier: Apache-2.0
// Movers as obstacles, against the simulator's truth: true boxes, silhouettes by depth, the true path of the camera.
#include <gtest/gtest.h>

#include <algorithm>
#include <future>
#include <iostream>

#include "dkb/dynamics/mover_tracker.h"
#include "dkb/dynamics/silhouette.h"
#include "dkb/simulator/simulator.h"
#include "mover_evaluation.h"

namespace dkb {
namespace {

std::vector<SimulatedFrame> render(const Simulator& simulator) {
  const int frames = simulator.frames(), half = frames / 2;
  const auto part = [&](int first, int end) {
    std::vector<SimulatedFrame> rendered;
    for (int i = first; i < end; ++i) {
      rendered.push_back(simulator.render(i));
      rendered.back().image.colour = {};
      rendered.back().true_depth = {};
    }
    return rendered;
  };
  auto second = std::async(std::launch::async, part, half, frames);
  std::vector<SimulatedFrame> all = part(0, half);
  for (SimulatedFrame& f : second.get()) all.push_back(std::move(f));
  return all;
}

enum class MaskFrom { silhouettes, truth };

struct FollowedScene {
  MoverRows truth, estimate;
  std::vector<Eigen::Vector3d> cameras;  // per frame, in the truth's world
  std::vector<double> stamps;            // [s] per frame

  MoverEvaluation evaluate() const {
    const auto camera = [this](double time) {
      const auto row = std::lower_bound(stamps.begin(), stamps.end(), time - 1e-6);
      return cameras.at(static_cast<size_t>(row - stamps.begin()));
    };
    return evaluate_movers(truth, estimate, Rigid3(), camera);
  }
};

FollowedScene follow(const std::vector<SimulatedFrame>& frames, const CameraModel& camera, MaskFrom mask_from) {
  MoverTracker tracker(camera, {});
  FollowedScene scene;
  for (const SimulatedFrame& f : frames) {
    std::vector<Detection> boxes;
    for (const SimulatedMover& m : f.movers) {
      const Box box{static_cast<float>(m.box_x), static_cast<float>(m.box_y), static_cast<float>(m.box_width),
                    static_cast<float>(m.box_height)};
      boxes.push_back({m.kind, box, 1});
      Mover mover;
      mover.id = m.id;
      mover.class_name = m.kind;
      mover.position_in_world = m.position_in_world;
      mover.velocity_in_world = m.velocity_in_world;
      mover.box = box;
      scene.truth.push_back({f.image.timestamp, f.stamp, std::move(mover)});
    }
    MoverMask mask;
    if (mask_from == MaskFrom::truth)
      unite(mask, MoverMask{1, f.mask}, camera.width, camera.height);
    else
      mask = silhouettes(f.image.depth, boxes, camera, {}).mask;
    for (Mover& m : tracker.update(tracker.look(f.image.timestamp, f.image.depth, mask, boxes, f.world_from_cam),
                                   f.image.depth, f.world_from_cam))
      scene.estimate.push_back({f.image.timestamp, f.stamp, std::move(m)});
    scene.cameras.push_back(f.world_from_cam.translation);
    scene.stamps.push_back(f.image.timestamp);
  }
  return scene;
}

class Movers : public testing::TestWithParam<const char*> {};

TEST_P(Movers, ArePlacedWithin15CentimetresAndKeepTheirIds) {
  SimulatorOptions options;
  options.scene = GetParam();
  options.width = 320;
  options.height = 240;
  options.frames = 240;
  const Simulator simulator(options);
  const std::vector<SimulatedFrame> frames = render(simulator);
  for (const MaskFrom mask_from : {MaskFrom::silhouettes, MaskFrom::truth}) {
    const FollowedScene scene = follow(frames, simulator.camera(), mask_from);
    const MoverEvaluation result = scene.evaluate();
    std::cout << GetParam() << (mask_from == MaskFrom::truth ? ", true masks: " : ", silhouettes: ") << result.found
              << " of " << result.true_movers << " found, " << result.false_movers << " false, position "
              << result.median_position_error << " m, velocity " << result.median_velocity_error << " m/s, "
              << result.kept << " of " << result.crossings << " ids kept\n";
    EXPECT_LE(result.median_position_error, 0.15);
    EXPECT_GE(result.found * 10, result.true_movers * 6);
    EXPECT_EQ(parse_movers(movers_to_csv(scene.estimate), "movers.csv").size(), scene.estimate.size());
    EXPECT_EQ(movers_to_csv(follow(frames, simulator.camera(), mask_from).estimate), movers_to_csv(scene.estimate))
        << "not deterministic";
    EXPECT_GE(result.crossings, 4u);
    EXPECT_GE(result.kept_share(), 0.9);
    // What was taken for a mover once is not one for ever.
    EXPECT_LE(result.false_movers * 4, result.found);
  }
}

INSTANTIATE_TEST_SUITE_P(Scenes, Movers, testing::Values("crowd", "rush"));

}  // namespace
}  // namespace dkb
