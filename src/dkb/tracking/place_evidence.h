// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <vector>

#include "dkb/matching/candidates.h"

namespace dkb {

// A map point in view, and whether it looks there as the map has it.
struct PointLook {
  PointId id = kNoPoint;
  bool same = true;
};

// What views tell of whether a place is the one that the map knows, or another one that looks like it: two rooms with
// the same furniture differ in a picture here and some books there. Collected while a camera is lost. Deterministic.
class PlaceEvidence {
 public:
  // What one frame shows; a point that is named twice counts once.
  void add(std::vector<PointLook> looks);
  // Log odds that what is in view is the place of these points, against a look-alike: five to one where nothing is
  // seen.
  double log_odds(const std::vector<Candidate>& points) const;
  void clear() { votes_.clear(); }

 private:
  std::map<PointId, int> votes_;  // views in which it looked the same, less those in which it did not
};

}  // namespace dkb
