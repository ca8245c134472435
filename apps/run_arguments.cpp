// SPDX-License-Identifier: Apache-2.0
// Which options of a run contradict each other, and what they leave out.
#include <algorithm>

#include "dkb/dataset/detector_choice.h"
#include "dkb/detection/onnx_network.h"
#include "dkb/sources/source_registry.h"
#include "dkb/util/errors.h"
#include "run_session.h"

namespace dkb {

// That --filter none, --disable dr and --preset orb win over a detector is no contradiction: comparisons of filters run
// with the same detector.
void check_detector(const DetectorChoice& choice, bool has_model) {
  inference_named(choice.inference);
  const std::vector<std::string> kinds = detector_kinds(choice.kinds, has_model);
  const bool yolo = std::find(kinds.begin(), kinds.end(), "yolo") != kinds.end();
  const bool slow = yolo || (!kinds.empty() && kinds.back().starts_with("exec:"));
  if (!yolo) check_no_network(choice);
  if (choice.every > 0 && !slow) refuse_option(choice, "--detect-every", "network or command");
  if (choice.latency > 0 && !slow) refuse_option(choice, "--detect-latency", "network or command");
}

void check_arguments(const RunArguments& args, const Options& options) {
  if (args.localize && args.load_map.empty()) throw InputError("--localize: needs a map; give --load-map FILE");
  if (args.localize && args.dense)
    throw InputError("--dense: --localize makes no keyframes, which the dense map is made of; leave one of them out");
  if (args.localize && args.final_ba)
    throw InputError("--final-ba: --localize does not change the map; leave one of them out");
  if (args.has_preset && options.preset() != args.preset)
    throw InputError("--preset " + args.preset + ": the settings say `preset: " + options.preset() +
                     "`; leave one of them out");
  check_detector(args.detection, !model_of(args.detection).empty());
  if (!args.prior_file.empty() && args.prior != "auto" && args.prior != "none")
    throw InputError("--prior " + args.prior + ": --prior-file takes its place; leave one of them out");
  const char* topic = !args.reading.odom_topic.empty()  ? "--odom-topic"
                      : !args.reading.imu_topic.empty() ? "--imu-topic"
                                                        : nullptr;
  if (topic != nullptr && !args.prior_file.empty())
    throw InputError(std::string(topic) + ": --prior-file takes its place; leave one of them out");
  if (topic != nullptr && args.prior == "none")
    throw InputError(std::string(topic) + ": --prior none reads no topic; leave one of them out");
  if (args.cv_orb && is_live(args.source))
    throw InputError("--cv-orb: reads the images again, which a camera does not give twice; leave it out");
  if (!args.viewer.on && args.viewer.exit) throw InputError("--viewer-exit: there is no page; add --viewer");
  if (!args.viewer.on && args.viewer.has_host) throw InputError("--viewer-host: there is no page; add --viewer");
}

bool takes_all_images(const RunArguments& args) {
  const SourceOptions whole;
  return args.reading.skip_pairs == whole.skip_pairs && args.reading.start == whole.start &&
         args.reading.end == whole.end && !args.reading.max_frames;
}

}  // namespace dkb
