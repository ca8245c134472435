// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>

#include "dkb/recordings/recording_file.h"
#include "dkb_slam/source.h"

namespace dkb {

struct ConvertOptions {
  SourceOptions source;                         // of which the camera, and the topics for a folder to be made, count
  Compression compression = Compression::none;  // of a recording's chunks
  bool raw = false;  // folder to recording: colour as pixels, where else the files are kept as they are
  std::function<void(const std::string&)> warn = [](const std::string&) {};
  std::function<void()> go_on = [] {};  // called before each pair or message; what it throws ends the conversion
};

// Writes a folder in any of the known layouts, or a recording, anew, as a folder, FILE.bag or FILE.mcap, so that the
// same frames are read from it: images and depths bit for bit, stamps to the nanosecond, the camera file with all its
// fields. A recording made of a recording keeps its messages in their order, of the types that are known here. Returns
// how many pairs, or messages, there were. Throws InputError; what has the name of `out` is then what it was.
struct Converted {
  size_t count = 0;
  std::string unit;  // "pairs", "messages"
};
Converted convert(const std::filesystem::path& in, const std::filesystem::path& out, const ConvertOptions& options);

}  // namespace dkb
