// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/detector_choice.h"

#include <algorithm>
#include <cstdlib>
#include <sstream>
#include <string_view>

#include "dkb/dataset/image_codecs.h"
#include "dkb/detection/boxes_file.h"
#include "dkb/detection/exec_detector.h"
#include "dkb/detection/mask_folder.h"
#include "dkb/detection/onnx_detector.h"
#include "dkb/util/errors.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"

namespace dkb {
namespace {

constexpr std::string_view kExec = "exec:";

}  // namespace

std::vector<std::string> detector_kinds(const std::string& detector, bool has_model) {
  if (detector == "auto") return {has_model ? "yolo" : "motion"};
  const std::vector<std::string> known = {"auto", "none", "yolo", "network", "motion", "file"};
  std::vector<std::string> kinds;
  size_t command = ("+" + detector).find("+" + std::string(kExec));  // the last kind, since a command may hold a +
  if (const size_t blank = detector.find("+ " + std::string(kExec)); blank < command) command = blank + 2;
  std::string before = detector.substr(0, command);
  std::erase(before, ' ');
  std::istringstream parts(before);
  for (std::string kind; std::getline(parts, kind, '+');) {
    if (kind == "auto")
      throw InputError("--detector " + detector +
                       ": auto cannot be joined to others; name what it stands for, yolo or motion");
    if (std::find(known.begin() + 1, known.end(), kind) == known.end())
      throw InputError("--detector: there is no detector \"" + kind + "\"" + did_you_mean(kind, known) +
                       "; detectors: auto, none, yolo (network), motion, file, exec:COMMAND, or several joined by +");
    if (kind == "network") kind = "yolo";
    if (std::find(kinds.begin(), kinds.end(), kind) != kinds.end())
      throw InputError("--detector " + detector + ": names " + kind + " twice; name it once");
    kinds.push_back(kind);
  }
  if (command != std::string::npos) kinds.push_back(detector.substr(command));
  if (kinds.size() > 1 && std::find(kinds.begin(), kinds.end(), "none") != kinds.end())
    throw InputError("--detector " + detector + ": none cannot be joined to others; leave it out");
  std::erase(kinds, "none");
  return kinds;
}

std::filesystem::path model_of(const DetectorChoice& choice) {
  const char* model = std::getenv("DKB_SLAM_MODEL");
  return choice.model.empty() && model != nullptr ? model : choice.model;
}

void refuse_option(const DetectorChoice& choice, const std::string& option, const std::string& reader) {
  throw InputError(option + ": --detector " + choice.kinds + " has no " + reader +
                   "; leave it out, or add a detector that has one");
}

void check_no_network(const DetectorChoice& choice) {
  const char* option = !choice.model.empty()                            ? "--model"
                       : !choice.labels.empty()                         ? "--labels"
                       : !choice.classes.empty()                        ? "--classes"
                       : choice.inference != DetectorChoice().inference ? "--inference"
                                                                        : nullptr;
  if (option == nullptr) return;
  const std::string remedy = choice.kinds == "auto"   ? ", or name a network with --model"
                             : choice.kinds == "none" ? ", or take --detector yolo with --model"
                             : choice.kinds.find(kExec) != std::string::npos
                                 ? ""
                                 : ", or take --detector " + choice.kinds + "+yolo with --model";
  throw InputError(std::string(option) + ": --detector " + choice.kinds + " has no network; leave it out" + remedy);
}

void check_kinds(const DetectorChoice& choice, bool has_model) {
  const std::vector<std::string> kinds = detector_kinds(choice.kinds, has_model);
  const auto has = [&](const char* kind) { return std::find(kinds.begin(), kinds.end(), kind) != kinds.end(); };
  if (!has("yolo")) check_no_network(choice);
  if (has("yolo") && !has_model)
    throw InputError(
        "--detector yolo: no model; name an ONNX file with --model or in the environment variable DKB_SLAM_MODEL");
  if (has("yolo") && kinds.back().starts_with(kExec))
    throw InputError("--detector: yolo and exec cannot be joined; leave one of them out");
  if (!choice.boxes.empty() && !has("file"))
    throw InputError("--boxes: --detector " + choice.kinds + " does not read boxes; add --detector file" +
                     (kinds.empty() || choice.kinds == "auto" ? "" : ", or join it: " + choice.kinds + "+file"));
  if (has("file") && choice.boxes.empty())
    throw InputError(std::string("--detector file: no boxes; name their file with --boxes") +
                     (choice.masks.empty() ? "" : "; --masks goes with any other detector, --detector none too"));
}

DetectorChoice choice_beside(const Options& options, std::string disabled, DetectorChoice choice) {
  if (options.dynamics.filter != FilterKind::none) return choice;
  std::erase(disabled, ' ');
  const bool asked_for = ("," + disabled + ",").find(",dr,") != std::string::npos || options.preset() == "orb";
  if (asked_for) choice.masks.clear();
  choice.kinds = "none";
  choice.boxes.clear();
  choice.model.clear();
  choice.labels.clear();
  choice.classes.clear();
  choice.inference = DetectorChoice().inference;
  return choice;
}

Detectors make_detectors(const DetectorChoice& choice, const Camera& camera) {
  Detectors made;
  const Inference inference = inference_named(choice.inference);
  const std::filesystem::path model = model_of(choice);
  check_kinds(choice, !model.empty());
  const std::vector<std::string> kinds = detector_kinds(choice.kinds, !model.empty());
  const auto has = [&](const char* kind) { return std::find(kinds.begin(), kinds.end(), kind) != kinds.end(); };
  if (has("yolo")) {
    OnnxOptions options{.model = model, .labels = choice.labels, .inference = inference};
    if (!choice.classes.empty()) options.classes = choice.classes;
    auto detector = std::make_shared<OnnxDetector>(options, camera.width, camera.height);
    const int frames = detector->frames_per_detection(camera.fps > 0 ? camera.fps : 30);
    made.schedule.every = choice.every > 0 ? choice.every : frames;
    made.schedule.latency = choice.latency > 0 ? choice.latency : frames;
    made.inference = to_string(detector->inference());
    made.slow = std::move(detector);
  }
  if (!kinds.empty() && kinds.back().starts_with(kExec)) {
    made.slow = std::make_shared<ExecDetector>(kinds.back().substr(kExec.size()));
    if (choice.every > 0) made.schedule.every = choice.every;
    if (choice.latency > 0) made.schedule.latency = choice.latency;
  }
  if (has("file")) made.prompt.push_back(std::make_shared<FileDetector>(choice.boxes, camera.width, camera.height));
  if (!choice.masks.empty()) {
    std::vector<double> stamps;
    for (int64_t stamp : choice.stamps_ns) stamps.push_back(seconds_from_ns(stamp));
    made.prompt.push_back(std::make_shared<MaskFolder>(choice.masks, read_mask, stamps, camera.width, camera.height));
  }
  made.motion = has("motion");
  return made;
}

}  // namespace dkb
