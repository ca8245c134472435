// SPDX-License-Identifier: Apache-2.0
// What is read of text: trajectories, lists of images, boxes, movers, scenes, suites and published figures. Each input
// goes to every parser, since a file of one kind given for another is a user's usual mistake.
#include <cstdint>
#include <string>

#include "bench/bench_suite.h"
#include "dkb/dataset/movers_file.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/dataset/tum_dataset.h"
#include "dkb/detection/boxes_file.h"
#include "dkb/simulator/scene.h"
#include "dkb/util/errors.h"

namespace {

void refused_or_read(const auto& parse) {
  try {
    parse();
  } catch (const dkb::InputError&) {
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  refused_or_read([&] { dkb::parse_trajectory(text, "trajectory.txt"); });
  refused_or_read([&] { dkb::parse_image_list(text, "rgb.txt"); });
  refused_or_read([&] { dkb::parse_associations(text, "associations.txt", "/"); });
  refused_or_read([&] { dkb::parse_boxes(text, "boxes.txt", 640, 480); });
  refused_or_read([&] { dkb::parse_movers(text, "movers.csv"); });
  dkb::sim::SceneRequest request;
  request.frames = 3;
  refused_or_read([&] { dkb::sim::parse_scene(text, "scene.yaml", request); });
  dkb::bench::SuiteText suite;
  suite.file = "suite.yaml", suite.text = text;
  refused_or_read([&] { dkb::bench::parse_suite(suite); });
  refused_or_read([&] { dkb::bench::parse_published(text, "published.yaml"); });
  return 0;
}
