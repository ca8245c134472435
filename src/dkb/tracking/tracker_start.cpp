// SPDX-License-Identifier: Apache-2.0
// How a map starts.
#include <algorithm>
#include <utility>

#include "dkb/tracking/tracker.h"

namespace dkb {
namespace {

constexpr double kStartSd = 1e-3;   // [m, rad] of a map's first pose, which is exact by definition
constexpr double kGoOnAfter = 0.1;  // [s] without a pose by the images: more than a blurred one or two

}  // namespace

// A map starts where enough depth is in view: the first at once, another one when the old one stays out of sight. Where
// a prior tells how the camera came here, the old map goes on instead, with a keyframe that shows nothing of it.
bool Tracker::start_map(TrackedFrame& frame, const PosePrediction* expected) {
  if (!lost_) lost_.emplace();
  const double before = std::exchange(lost_->at, frame.timestamp);
  if (frame.with_depth < options_.initial_points) {
    // What cannot start a map says nothing of whether the old one is in sight: its time does not count.
    if (lost_->since) *lost_->since += frame.timestamp - before;
    return false;
  }
  // Nothing followed from the map's first frame: the map begins again, without what that frame made.
  const auto step =
      expected == nullptr && last_ && last_->starts_map ? expected_step(frame.timestamp, nullptr) : std::nullopt;
  if (state_ != TrackingState::initialising && !step) {
    if (!lost_->since) lost_->since = frame.timestamp;
    // Where the way here is known and the map's points are not found, there are none.
    const double wait = expected != nullptr ? std::min(kGoOnAfter, options_.new_map_after) : options_.new_map_after;
    if (options_.new_map_after == 0 || frame.timestamp - *lost_->since < wait) return false;
  }
  if (step) {
    frame.predicted = pose_after(*step);
    expected = &*frame.predicted;
    std::vector<PointId> made = last_->points;
    std::erase(made, kNoPoint);
    retract(made);
  }
  frame.inliers = frame.with_depth;
  frame.cam_from_world = last_ ? last_->cam_from_world : suggested_ ? suggested_->cam_from_world : start_;
  frame.covariance = Matrix6d::Identity() * (kStartSd * kStartSd);
  if (expected != nullptr) {
    frame.cam_from_world = expected->cam_from_world;
    frame.covariance = expected->covariance;
    frame.reference = last_->reference;
    frame.cam_from_reference = frame.cam_from_world * map_.cam_from_world(frame.reference).inverse();
  }
  drop_unmatched_suspects(frame);
  candidates_made_.reset();
  if (expected == nullptr) velocity_.reset();
  return true;
}

// The first frame of a map is seen at a velocity that nobody knows yet. Left as it is, a map made in a turn is sheared,
// and the next frame, whose features are straight, fits it at a wrong angle.
void Tracker::remake_start(std::shared_ptr<const RgbdFeatures> features, TrackedFrame& next) {
  // Those on movers were left out when the map started.
  if (features->size() != last_->source.size())
    features = std::make_shared<const RgbdFeatures>(subset(*features, last_->source));
  std::vector<PointId> gone;
  for (auto& [id, p] : provisional_) {
    if (birth_keyframe(id) != last_->reference) continue;
    const Keypoint& k = features->keypoints[static_cast<size_t>(birth_feature(id))];
    if (k.depth > 0)
      p.point_in_keyframe = optics_.camera.unproject(k.pixel.cast<double>(), k.depth);
    else
      gone.push_back(id);
  }
  for (PointId id : gone) {
    provisional_.erase(id);
    std::replace(last_->points.begin(), last_->points.end(), id, kNoPoint);
    next.inliers -= static_cast<int>(std::count(next.points.begin(), next.points.end(), id));
    std::replace(next.points.begin(), next.points.end(), id, kNoPoint);
    std::replace(next.matched.begin(), next.matched.end(), id, kNoPoint);
  }
  for (size_t f = 0; f < next.matched.size(); ++f)
    if (next.matched[f] != kNoPoint) next.matched_in_world[f] = *position(next.matched[f]);
  last_->features = features;
  next.start_features = std::move(features);
}

void Tracker::remake(const TrackedFrame& next, KeyframePacket& packet) const {
  packet.features = next.start_features;
  std::erase_if(packet.new_points, [this](ProvisionalPoint& p) {
    const auto now = provisional_.find(p.id);
    if (now != provisional_.end()) p = now->second;
    return now == provisional_.end();
  });
}

}  // namespace dkb
