// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace dkb::sim {

// Numbers of the frames that are left of 0 ... count - 1 when `share` of them is missing: half of the gaps are single
// frames, the others bursts of 2 ... 8. The first frame stays.
std::vector<int> frames_left(int count, double share, uint64_t seed);

// Light and exposure that change: automatic exposure that jumps every 0.4 ... 1.5 s to 0.5 ... 1.8 times the
// brightness, and lamps at 100 Hz, which a shutter shorter or longer than one of their periods sees as bands.
class Flicker {
 public:
  Flicker(double duration, uint64_t seed);
  // Of the camera: the same for all rows of a frame.
  double gain(double t) const;
  // Of the lamps at the time at which a row is read; `exposure` [s].
  double lamps(double t, double exposure) const;

 private:
  struct Step {
    double time, gain;
  };
  std::vector<Step> steps_;
  double phase_ = 0;
};

}  // namespace dkb::sim
