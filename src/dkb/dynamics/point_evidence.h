// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <map>
#include <vector>

#include "dkb/map/ids.h"
#include "dkb/util/errors.h"

namespace dkb {

struct PointEvidenceOptions {
  // [s] that a point must be seen on a mover, less twice the time it is found still, to be retracted, > 0.
  double seconds = 0.32;
  void check() const { require_option(seconds > 0, "dynamics.evidence_seconds", seconds, "greater than 0 s"); }
};

// What the frames say of each map point over time: is it on a mover, or does it fit the still world? Deterministic.
class PointEvidence {
 public:
  explicit PointEvidence(PointEvidenceOptions options) : options_(options) { options_.check(); }

  // Points that were found still, and points that stand on a mover, in the frame of `timestamp` [s]. Returns those with
  // enough against them by now, increasing; each once.
  std::vector<PointId> weigh(double timestamp, const std::vector<PointId>& still, const std::vector<PointId>& on_mover) {
    // After a gap a frame is no more than one look: four are needed at any rate.
    const double seconds = std::clamp(timestamp - timestamp_, 0.0, kMaxLook);
    timestamp_ = timestamp;
    for (PointId point : still) {
      const auto it = suspicion_.find(point);
      if (it != suspicion_.end() && (it->second -= 2 * seconds) <= 0) suspicion_.erase(it);
    }
    for (PointId point : on_mover) suspicion_[point] += seconds;
    std::vector<PointId> convicted;
    for (const auto& [point, suspicion] : suspicion_)
      if (suspicion >= options_.seconds) convicted.push_back(point);
    for (PointId point : convicted) suspicion_.erase(point);
    return convicted;
  }

 private:
  static constexpr double kMaxLook = 0.1;  // [s]

  PointEvidenceOptions options_;
  double timestamp_ = 0;                  // of the frame weighed last
  std::map<PointId, double> suspicion_;  // [s]
};

}  // namespace dkb
