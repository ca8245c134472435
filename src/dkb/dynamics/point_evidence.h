// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

#include "dkb/map/ids.h"

namespace dkb {

// What the frames say of each map point over time: is it on a mover, or does it fit the still world? Deterministic.
class PointEvidence {
 public:
  bool suspects() const { return !suspects_.empty(); }
  // Points that are no more are no suspects.
  template <class Lives>
  void keep(const Lives& lives) {
    std::erase_if(suspects_, [&](const Suspect& s) { return !lives(s.point); });
  }
  // Points that were found still, by increasing id, and points that stand on a mover, in the frame of `timestamp` [s].
  // Returns those with enough against them by now, increasing; each once.
  std::vector<PointId> weigh(double timestamp, const std::vector<PointId>& still,
                             const std::vector<PointId>& on_mover) {
    // After a gap a frame is no more than one look: four are needed at any rate.
    const double seconds = std::clamp(timestamp - timestamp_, 0.0, kMaxLook);
    timestamp_ = timestamp;
    auto at = suspects_.begin();
    for (PointId point : still) {
      at = std::lower_bound(at, suspects_.end(), point, before);
      if (at == suspects_.end()) break;
      if (at->point == point) at->seconds -= 2 * seconds;
    }
    std::erase_if(suspects_, [](const Suspect& s) { return s.seconds <= 0; });
    for (PointId point : on_mover) {
      at = std::lower_bound(suspects_.begin(), suspects_.end(), point, before);
      if (at == suspects_.end() || at->point != point) at = suspects_.insert(at, {point, 0});
      at->seconds += seconds;
    }
    std::vector<PointId> convicted;
    for (const Suspect& s : suspects_)
      if (s.seconds >= kConvicting) convicted.push_back(s.point);
    std::erase_if(suspects_, [](const Suspect& s) { return s.seconds >= kConvicting; });
    return convicted;
  }

 private:
  // [s] on a mover, less twice the time found still. A third of it ate the map (docs/decisions.md).
  static constexpr double kConvicting = 0.32;
  static constexpr double kMaxLook = 0.1;  // [s]

  struct Suspect {
    PointId point = kNoPoint;
    double seconds = 0;  // against it
  };
  static bool before(const Suspect& s, PointId point) { return s.point < point; }

  double timestamp_ = 0;           // of the frame weighed last
  std::vector<Suspect> suspects_;  // by increasing point
};

}  // namespace dkb
