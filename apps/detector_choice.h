// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/slam/dynamic_stage.h"

namespace dkb {

// The options of `run` that choose detectors.
struct DetectorArguments {
  std::string detector = "auto";  // auto, none, or kinds joined by '+': yolo, motion, file
  std::string model, labels, boxes, masks;
  int every = 0, latency = 0;  // [frames] 0 = by the size of the model
};

// The kinds named by --detector, `none` left out; `auto` is `yolo` when there is a model, else `motion`. Throws
// InputError for one that does not exist.
std::vector<std::string> detector_kinds(const std::string& detector, const std::string& model);

// Makes them; every fault of a model or file is thrown here, before any frame (InputError).
DetectorSet make_detectors(const DetectorArguments& arguments, const CameraModel& camera,
                           const std::vector<double>& stamps, bool threaded, bool realtime);

}  // namespace dkb
