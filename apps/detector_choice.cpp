// SPDX-License-Identifier: Apache-2.0
#include "detector_choice.h"

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "dkb/dataset/image_codecs.h"
#include "dkb/detection/boxes_file.h"
#include "dkb/detection/mask_folder.h"
#include "dkb/detection/onnx_detector.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"

namespace dkb {

std::vector<std::string> detector_kinds(const std::string& detector, const std::string& model) {
  if (detector == "auto") return {model.empty() ? "motion" : "yolo"};
  const std::vector<std::string> known = {"auto", "none", "yolo", "motion", "file"};
  std::vector<std::string> kinds;
  std::istringstream parts(detector);
  for (std::string kind; std::getline(parts, kind, '+');) {
    if (std::find(known.begin() + 1, known.end(), kind) == known.end())
      throw InputError("--detector: there is no detector \"" + kind + "\"" + did_you_mean(kind, known) +
                       "; detectors: auto, none, yolo, motion, file, or several joined by +");
    if (kind != "none") kinds.push_back(kind);
  }
  return kinds;
}

DetectorSet make_detectors(const DetectorArguments& arguments, const CameraModel& camera,
                           const std::vector<double>& stamps, bool threaded, bool realtime) {
  DetectorSet set;
  std::string model = arguments.model;
  if (const char* from_environment = std::getenv("DKB_SLAM_MODEL"); model.empty() && from_environment != nullptr)
    model = from_environment;
  const std::vector<std::string> kinds = detector_kinds(arguments.detector, model);
  const auto has = [&](const char* kind) { return std::find(kinds.begin(), kinds.end(), kind) != kinds.end(); };
  if (has("yolo")) {
    if (model.empty())
      throw InputError(
          "--detector yolo: no model; name an ONNX file with --model or in the environment variable DKB_SLAM_MODEL");
    OnnxOptions options;
    options.model = model;
    options.labels = arguments.labels;
    auto detector = std::make_unique<OnnxDetector>(options, camera.width, camera.height);
    const int frames = detector->frames_per_detection();
    set.schedule.every = arguments.every > 0 ? arguments.every : frames + 1;
    set.schedule.latency = arguments.latency > 0 ? arguments.latency : frames + 1;
    set.schedule.threaded = threaded;
    set.schedule.realtime = realtime;
    set.slow = std::move(detector);
  }
  if (!arguments.boxes.empty() && !has("file"))
    throw InputError(
        "--boxes: --detector " + arguments.detector + " does not read boxes; add --detector file" +
        (kinds.empty() || arguments.detector == "auto" ? "" : ", or join it: " + arguments.detector + "+file"));
  if (has("file")) {
    if (arguments.boxes.empty()) throw InputError("--detector file: no boxes; name their file with --boxes");
    set.prompt.push_back(std::make_unique<FileDetector>(arguments.boxes, camera.width, camera.height));
  }
  if (!arguments.masks.empty())
    set.prompt.push_back(std::make_unique<MaskFolder>(arguments.masks, read_grey, stamps, camera.width, camera.height));
  set.motion = has("motion");
  return set;
}

}  // namespace dkb
