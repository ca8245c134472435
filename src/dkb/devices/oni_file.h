// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "dkb_slam/source.h"

namespace dkb {

// A recording of OpenNI 2 (.oni): the first depth stream and the first colour stream in it, every frame. Read without
// OpenNI's library, whose player shows nothing of recordings that lack properties which real cameras have. The camera
// is SourceOptions::camera, else what the field of view says. Images that were recorded mirrored are turned back. A
// recording that is cut off is used up to the cut. Throws InputError.
std::unique_ptr<Source> open_oni_file(const std::filesystem::path& path, const SourceOptions& options);

}  // namespace dkb
