// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "dkb/map/ids.h"
#include "dkb/util/errors.h"

namespace dkb {

struct PointEvidenceOptions {
  int min_observations =
      10;  // times that a point must lie on a mover, less twice the times it was found still, to be retracted, >= 1
  void check() const {
    require_option(min_observations >= 1, "dynamics.evidence_observations", min_observations, "at least 1");
  }
};

// What the frames say of each map point over time: was it on a mover, or did it fit the still world?
class PointEvidence {
 public:
  explicit PointEvidence(PointEvidenceOptions options) : options_(options) { options_.check(); }
  void on_mover(PointId point) { ++suspicion_[point]; }
  void fits_still_world(PointId point) {
    const auto it = suspicion_.find(point);
    if (it != suspicion_.end() && (it->second -= 2) <= 0) suspicion_.erase(it);
  }
  // Points with enough against them, increasing; each once.
  std::vector<PointId> take_convicted() {
    std::vector<PointId> convicted;
    for (auto it = suspicion_.begin(); it != suspicion_.end();) {
      if (it->second >= options_.min_observations) {
        convicted.push_back(it->first);
        it = suspicion_.erase(it);
      } else {
        ++it;
      }
    }
    return convicted;
  }

 private:
  PointEvidenceOptions options_;
  std::map<PointId, int> suspicion_;
};

}  // namespace dkb
