// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "dkb/dense/dense_mapper.h"
#include "dkb/slam/slam_system.h"
#include "dkb/util/timing.h"

namespace dkb {

// run --dense: notes keyframes as they come and writes the dense map of the still world at the end.
class DenseOutput {
 public:
  explicit DenseOutput(const SlamSystem& slam);

  // After each frame that `slam` has processed.
  void note(const RgbdImage& image, const FrameResult& result, const SlamSystem& slam);
  // dense.ply, and occupancy.pgm and occupancy.yaml when there is a floor. After slam.finish(). Returns a line for the
  // user. Throws OutputError.
  std::string write(const std::filesystem::path& folder, const SlamSystem& slam);
  const StageTimes& times() const { return times_; }

 private:
  DenseMapper mapper_;
  StageTimes times_;
};

}  // namespace dkb
