// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/simulator/scene.h"
#include "dkb/util/errors.h"

namespace dkb::sim {
namespace {

TEST(SceneFile, NoMutationDoesMoreThanBeRefused) {
  const std::string text =
      "frames: 20\npeople: 2\nexposure_ms: 10\ntremor: 0.5\n"
      "room: {size: [5, 4], height: 2.6, floor: carpet, furnished: false}\n"
      "path:\n  - {time: 0, position: [0, -1.5, 1.4], look_at: [0, 1, 0.8]}\n"
      "  - {time: 1, position: [0.5, -1.5, 1.4], look_at: [0, 1, 0.8]}\n"
      "objects:\n  - {kind: box, position: [0, 1, 1], yaw: 30, size: [0.5, 0.5, 0.5], material: carton}\n"
      "movers:\n  - {class: person, waypoints: [{time: 0, position: [0, 0]}, {time: 1, position: [1, 0]}]}\n";
  ASSERT_EQ(parse_scene(text, "scene.yaml", {}).frames, 20);
  SceneRequest request;
  request.frames = 20;
  Random random(5);
  int refused = 0;
  for (int round = 0; round < 3000; ++round) {
    try {
      parse_scene(mutated(text, random), "scene.yaml", request);
    } catch (const InputError& e) {
      ++refused;
      EXPECT_EQ(std::string(e.what()).rfind("scene.yaml", 0), 0u) << e.what();
    }
  }
  EXPECT_GT(refused, 1000);
  EXPECT_LT(refused, 3000);
}

}  // namespace
}  // namespace dkb::sim
