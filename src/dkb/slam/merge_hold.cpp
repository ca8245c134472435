// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/merge_hold.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

namespace dkb {
namespace {

// All figures: chosen on `twins` and `loop` with a blackout, decisions.md.
constexpr double kThing = 0.15;             // [m] around a point in which others are of the same thing
constexpr int kVotes = 3, kMostVotes = 10;  // of a point that is judged
constexpr int kEnough = 200;                // judged points before two maps become one
constexpr double kSamePlace = 0.008;        // share of different ones below which they do
constexpr int kEnoughAgainst = 400;         // judged points before they are two for good
constexpr double kOtherPlace = 0.025;       // share of different ones above which they are

}  // namespace

PlaceDifference difference_of(std::vector<JudgedPoint> points) {
  std::stable_sort(points.begin(), points.end(),
                   [](const JudgedPoint& a, const JudgedPoint& b) { return a.position.x() < b.position.x(); });
  PlaceDifference difference;
  for (auto p = points.begin(); p != points.end(); ++p) {
    struct Near {
      double distance = std::numeric_limits<double>::infinity();
      bool different = false;
    };
    std::array<Near, 3> nearest;
    const auto meet = [&](const JudgedPoint& other) {
      const double distance = (other.position - p->position).norm();
      if (distance > kThing || distance >= nearest.back().distance) return;
      nearest.back() = {distance, other.votes < 0};
      std::stable_sort(nearest.begin(), nearest.end(),
                       [](const Near& a, const Near& b) { return a.distance < b.distance; });
    };
    for (auto q = p; q != points.begin() && p->position.x() - std::prev(q)->position.x() <= kThing; --q)
      meet(*std::prev(q));
    for (auto q = p + 1; q != points.end() && q->position.x() - p->position.x() <= kThing; ++q) meet(*q);
    if (std::isinf(nearest.back().distance)) continue;
    ++difference.judged;
    const auto others = std::count_if(nearest.begin(), nearest.end(), [](const Near& n) { return n.different; });
    difference.different += p->votes < 0 && others >= 2;
  }
  return difference;
}

void MergeHold::hold(std::shared_ptr<const MapCorrection> merge, const Map& map) {
  const KeyframeId here = map.root(merge->near_side.front()), there = map.root(merge->far_side.front());
  if (here == there) return;
  if (here != here_ || there != there_) {
    seen_.clear();
    refused_ = false;
  }
  here_ = here;
  there_ = there;
  if (refused_) return;
  near_ = merge->far_side.front();
  const MapCorrection::Pose& moved = merge->poses.front();
  here_from_there_ = moved.before.inverse() * moved.after;  // of the map that moves
  if (map.root(moved.keyframe) != here) here_from_there_ = here_from_there_.inverse();
  merge_ = std::move(merge);
}

std::shared_ptr<const MapCorrection> MergeHold::look(const Map& map, KeyframeId root, const TrackedFrame& frame,
                                                     PointAppearance* appearance) {
  if (!merge_) return nullptr;
  if (root != here_ || map.root(near_) != there_) {
    drop();
    return nullptr;
  }
  near_ = map.live_ancestor(near_).id;
  auto proposal = relocaliser_.propose_at(map, near_, frame.cam_from_world * here_from_there_, kSearchRadii[0],
                                          frame.matchable(), {});
  if (!proposal || !proposal->verified) return nullptr;
  near_ = map.observers_of(proposal->fit.points).front().keyframe;
  relocaliser_.look_around(map, appearance, *proposal);
  for (const PointLook& look : proposal->looks) {
    JudgedPoint& seen = seen_[look.id];
    seen.position = map.point(look.id)->position;
    seen.votes = std::clamp(seen.votes + (look.same ? 1 : -1), -kMostVotes, kMostVotes);
  }
  std::vector<JudgedPoint> points;
  for (const auto& [id, seen] : seen_)
    if (std::abs(seen.votes) >= kVotes) points.push_back(seen);
  const PlaceDifference difference = difference_of(std::move(points));
  if (difference.judged >= kEnough && difference.different < kSamePlace * difference.judged)
    return std::exchange(merge_, nullptr);
  refused_ = difference.judged >= kEnoughAgainst && difference.different > kOtherPlace * difference.judged;
  if (refused_) drop();
  return nullptr;
}

}  // namespace dkb
