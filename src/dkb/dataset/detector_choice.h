// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "dkb_slam/detector.h"
#include "dkb_slam/options.h"

namespace dkb {

// The kinds that DetectorChoice::kinds names, `none` left out, exec:COMMAND last; `auto` is `yolo` where there is a
// model, else `motion`, and `network` is another name of `yolo`. Throws InputError for one that does not exist.
std::vector<std::string> detector_kinds(const std::string& kinds, bool has_model);

// The model that is named, else that of $DKB_SLAM_MODEL; may be empty.
std::filesystem::path model_of(const DetectorChoice& choice);

// Throws InputError: nothing of the choice reads this option.
[[noreturn]] void refuse_option(const DetectorChoice& choice, const std::string& option, const std::string& reader);

// Throws InputError where a choice without a network names what only networks have.
void check_no_network(const DetectorChoice& choice);

// Throws InputError where the detectors of the choice lack what they need, or cannot be joined. No file is read.
void check_kinds(const DetectorChoice& choice, bool has_model);

// What of the choice holds beside the options: without a filter nothing is detected.
// `disabled`: the parts given to Options::disable(); without `dr` masks are not read either.
DetectorChoice choice_beside(const Options& options, std::string disabled, DetectorChoice choice);

}  // namespace dkb
