// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <map>
#include <vector>

#include "dkb/map/ids.h"

namespace dkb {

// What the frames say of each map point over time: is it on a mover, or does it fit the still world? Deterministic.
class PointEvidence {
 public:
  // Points that were found still, and points that stand on a mover, in the frame of `timestamp` [s]. Returns those with
  // enough against them by now, increasing; each once.
  std::vector<PointId> weigh(double timestamp, const std::vector<PointId>& still,
                             const std::vector<PointId>& on_mover) {
    // After a gap a frame is no more than one look: four are needed at any rate.
    const double seconds = std::clamp(timestamp - timestamp_, 0.0, kMaxLook);
    timestamp_ = timestamp;
    for (PointId point : still) {
      const auto it = suspicion_.find(point);
      if (it != suspicion_.end() && (it->second -= 2 * seconds) <= 0) suspicion_.erase(it);
    }
    std::vector<PointId> convicted;
    for (PointId point : on_mover)
      if ((suspicion_[point] += seconds) >= kConvicting) convicted.push_back(point);
    std::sort(convicted.begin(), convicted.end());
    convicted.erase(std::unique(convicted.begin(), convicted.end()), convicted.end());
    for (PointId point : convicted) suspicion_.erase(point);
    return convicted;
  }

 private:
  // [s] on a mover, less twice the time found still. A third of it ate the map (docs/decisions.md).
  static constexpr double kConvicting = 0.32;
  static constexpr double kMaxLook = 0.1;  // [s]

  double timestamp_ = 0;                 // of the frame weighed last
  std::map<PointId, double> suspicion_;  // [s]
};

}  // namespace dkb
