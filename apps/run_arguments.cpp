// SPDX-License-Identifier: Apache-2.0
// Which options of a run contradict each other.
#include <algorithm>

#include "dkb/dataset/detector_choice.h"
#include "dkb/util/errors.h"
#include "run_session.h"

namespace dkb {
namespace {

// Why nothing is detected; empty when something may be.
std::string why_no_filter(const RunArguments& args, const Options& options) {
  if (options.dynamics.filter != FilterKind::none) return "";
  if (("," + args.disable + ",").find(",dr,") != std::string::npos) return "--disable dr";
  if (!args.filter.empty()) return "--filter none";
  return options.preset() == "orb" ? "--preset orb" : "dynamics.filter none";
}

void check_detector(const RunArguments& args, const Options& options) {
  const DetectorChoice& choice = args.detection;
  const std::string no_filter = why_no_filter(args, options);
  if (!no_filter.empty()) {
    std::string given;
    if (args.has_detector && choice.kinds != "none") given = "--detector " + choice.kinds;
    if (!choice.model.empty()) given = "--model";
    if (!choice.boxes.empty()) given = "--boxes";
    if (!given.empty()) throw InputError(given + ": nothing is detected with " + no_filter + "; leave one of them out");
  }
  const DetectorChoice whole = choice_beside(options, args.disable, choice);  // with the model of the environment
  const std::vector<std::string> kinds = detector_kinds(whole.kinds, !whole.model.empty());
  const bool yolo = std::find(kinds.begin(), kinds.end(), "yolo") != kinds.end();
  const bool slow = yolo || (!kinds.empty() && kinds.back().starts_with("exec:"));
  const auto refuse = [&](const char* option, const char* reader) {
    throw InputError(std::string(option) + ": --detector " + choice.kinds + " has no " + reader +
                     "; leave it out, or add a detector that has one");
  };
  if (!choice.model.empty() && !yolo) refuse("--model", "network");
  if (!choice.labels.empty() && !yolo) refuse("--labels", "network");
  if (choice.every > 0 && !slow) refuse("--detect-every", "network or command");
  if (choice.latency > 0 && !slow) refuse("--detect-latency", "network or command");
}

}  // namespace

void check_arguments(const RunArguments& args, const Options& options) {
  if (args.localize && args.load_map.empty()) throw InputError("--localize: needs a map; give --load-map FILE");
  if (args.has_preset && options.preset() != args.preset)
    throw InputError("--preset " + args.preset + ": the settings say `preset: " + options.preset() +
                     "`; leave one of them out");
  check_detector(args, options);
  if (!args.viewer.on && args.viewer.exit) throw InputError("--viewer-exit: there is no page; add --viewer");
  if (!args.viewer.on && args.viewer.has_host) throw InputError("--viewer-host: there is no page; add --viewer");
}

}  // namespace dkb
