// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "dkb_slam/source.h"

namespace dkb {

// What a run wrote, as a recording that Foxglove, Rerun and RViz play (.mcap, or .bag): /tf (camera in map), /pose and
// /path, /map_points as a coloured cloud in the end, and, where `pictures` is given and the run wrote features.csv,
// /features_image with each feature in the colour of its state: green used, grey unused, yellow outlier, red dynamic.
// Returns the number of poses. Throws InputError, and InterruptedError on Ctrl-C.
size_t write_results_recording(const std::filesystem::path& results, Source* pictures,
                               const std::filesystem::path& out);

}  // namespace dkb
