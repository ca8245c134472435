// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "dkb/loop/loop_correction.h"

namespace dkb {

// Looks for loops keyframe by keyframe. Deterministic: the same snapshots in the same order give the same corrections.
class LoopCloser {
 public:
  LoopCloser(const Optics& optics, const LoopOptions& options, uint64_t seed);

  // Nothing is looked for from this keyframe: a loop that was closed just before is the one that it sees.
  bool rests(KeyframeId id) const { return id < rests_until_; }
  // `snapshot` holds keyframe `id`. What to do about the loop that it closes, if it does.
  std::optional<MapCorrection> process(const Map& snapshot, KeyframeId id);

 private:
  Optics optics_;
  LoopOptions options_;
  uint64_t seed_;
  KeyframeId rests_until_ = 0;  // keyframe before which nothing is looked for
};

}  // namespace dkb
