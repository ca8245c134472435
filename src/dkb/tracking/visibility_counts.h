// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <utility>
#include <vector>

#include "dkb/map/keyframe_packet.h"

namespace dkb {

// How often map points should have been in view, and how often they were found, since somebody took the counts: by
// increasing id. A frame has thousands of points, so they are merged into a row instead of sought one by one.
class VisibilityCounts {
 public:
  void add_visible(std::vector<PointId> points) { add(points, &PointVisibility::visible); }
  void add_found(std::vector<PointId> points) { add(points, &PointVisibility::found); }
  std::vector<PointVisibility> take() { return std::exchange(counts_, {}); }

 private:
  void add(std::vector<PointId>& points, int PointVisibility::*count) {
    if (!std::is_sorted(points.begin(), points.end())) std::sort(points.begin(), points.end());
    merged_.clear();
    auto at = counts_.begin();
    for (PointId id : points) {
      while (at != counts_.end() && at->point <= id) merged_.push_back(*at++);
      if (merged_.empty() || merged_.back().point != id) merged_.push_back({id, 0, 0});
      ++(merged_.back().*count);
    }
    merged_.insert(merged_.end(), at, counts_.end());
    counts_.swap(merged_);
  }

  std::vector<PointVisibility> counts_, merged_;
};

}  // namespace dkb
