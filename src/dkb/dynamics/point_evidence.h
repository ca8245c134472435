// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <iterator>
#include <map>
#include <vector>

#include "dkb/map/ids.h"

namespace dkb {

// What the frames say of each map point over time: is it on a mover, or does it fit the still world? Deterministic.
class PointEvidence {
 public:
  // Points that were found still, by increasing id, and points that stand on a mover, in the frame of `timestamp` [s].
  // Returns those with enough against them by now, increasing; each once.
  std::vector<PointId> weigh(double timestamp, const std::vector<PointId>& still,
                             const std::vector<PointId>& on_mover) {
    // After a gap a frame is no more than one look: four are needed at any rate.
    const double seconds = std::clamp(timestamp - timestamp_, 0.0, kMaxLook);
    timestamp_ = timestamp;
    auto found = still.begin();
    for (auto suspect = suspicion_.begin(); suspect != suspicion_.end();) {
      found = std::lower_bound(found, still.end(), suspect->first);
      const bool stands = found != still.end() && *found == suspect->first;
      suspect = stands && (suspect->second -= 2 * seconds) <= 0 ? suspicion_.erase(suspect) : std::next(suspect);
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
