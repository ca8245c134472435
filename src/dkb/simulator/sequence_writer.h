// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>

#include "dkb/simulator/simulator.h"

namespace dkb {

struct SequenceWriterOptions {
  int threads = 2;     // frames drawn at the same time, 1 ... 64; the files do not depend on it
  void check() const;  // throws InvalidOption
};

// Writes the whole sequence in TUM layout to `folder` (made if missing; files of the same names are replaced):
// rgb/STAMP.jpg, depth/STAMP.png (16 bit), rgb.txt, depth.txt, associations.txt, groundtruth.txt, camera.yaml,
// boxes.txt, masks/STAMP.png, movers.csv, and odometry.txt where it was asked for (TUM format, `# drift D` first). The
// lists come last, so that a folder with lists is complete. `progress` (may be empty) is called from this thread with
// the number of frames written. Throws OutputError naming the file.
void write_sequence(const Simulator& simulator, const std::filesystem::path& folder,
                    const std::function<void(int)>& progress = {}, const SequenceWriterOptions& options = {});

}  // namespace dkb
