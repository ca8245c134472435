// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "dkb_slam/source.h"

namespace dkb {

// What tells a command how to read a recording that does not tell it by itself: of every command that reads one.
inline void add_source_options(CLI::App& command, SourceOptions& options) {
  command.add_option("--camera", options.camera,
                     "Camera file, or fr1, fr2, fr3, bonn (default: what the recording says)");
  command.add_option("--colour-topic", options.colour_topic, "Of a recording with several topics of colour images");
  command.add_option("--depth-topic", options.depth_topic, "Likewise of depth images");
  command.add_option("--info-topic", options.info_topic, "Likewise of CameraInfo: the one of the colour images");
}

// The first of these that was given; empty if none was.
inline std::string source_option_given(const SourceOptions& options) {
  return !options.camera.empty()         ? "--camera"
         : !options.colour_topic.empty() ? "--colour-topic"
         : !options.depth_topic.empty()  ? "--depth-topic"
         : !options.info_topic.empty()   ? "--info-topic"
                                         : "";
}

}  // namespace dkb
