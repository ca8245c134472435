// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dkb/geometry/decompositions.h"
#include "dkb/matching/pose_observation.h"
#include "dkb/util/chi_square.h"
#include "dkb/util/radix_sort.h"

namespace dkb {
namespace {

// [s] since its birth until a point may be found where a mover is suspected: as long as the motion segmentation takes
// to trust a view in full, by which what moved at its birth is known.
constexpr double kEstablishedAfter = 0.5;
constexpr double kRefreshAfter = 0.15;       // [s] the choice of local map points is renewed at least so often
constexpr double kAccelerationShare = 0.25;  // chosen by measurement among 0, 0.25 and 0.5 (fr1_xyz)
constexpr double kOdometryWeight = 1.0 / 4;  // of visual-odometry points beside map points
constexpr float kMatchRatio = 0.8f;          // best over second best distance of a match with a map point

double square(double a) {
  return a * a;
}

}  // namespace

Tracker::Tracker(const Optics& optics, const TrackingOptions& options, uint64_t seed)
    : optics_(optics),
      options_(options),
      seed_(seed),
      relocaliser_(optics, seed),
      odometry_(optics, options.close_depth) {}

Rigid3 Tracker::take_view(MapView view) {
  map_.take_view(std::move(view));
  candidates_made_.reset();
  std::erase_if(provisional_, [&](const auto& p) { return map_.view().keyframe(birth_keyframe(p.first)) != nullptr; });
  std::erase_if(retracted_, [&](PointId id) {
    return map_.view().keyframe(birth_keyframe(id)) != nullptr && map_.view().point(id) == nullptr;
  });
  if (unconfirmed_) express_anew(*unconfirmed_);
  if (!last_) return {};
  return express_anew(*last_);
}

// A frame's pose and points by the view as it is now; how the world moved under its camera.
Rigid3 Tracker::express_anew(PosedFrame& frame) const {
  const Rigid3 moved = frame.cam_from_reference * map_.cam_from_world(frame.reference);
  const Rigid3 new_world_from_old = moved.inverse() * frame.cam_from_world;
  frame.cam_from_world = moved;
  std::vector<std::pair<PointId, size_t>> shown;
  shown.reserve(frame.points.size());
  for (size_t f = 0; f < frame.points.size(); ++f) {
    PointId& p = frame.points[f];
    if (p != kNoPoint && !provisional_.contains(p)) p = map_.view().resolve(p);
    if (p != kNoPoint) shown.emplace_back(p, f);
  }
  std::sort(shown.begin(), shown.end());
  // Two features may show points that have been fused since: the first keeps it.
  for (size_t i = 1; i < shown.size(); ++i)
    if (shown[i].first == shown[i - 1].first) frame.points[shown[i].second] = kNoPoint;
  return new_world_from_old;
}

std::optional<Eigen::Vector3d> Tracker::position(PointId id) const {
  if (const MapPoint* p = map_.view().point(id)) return p->position;
  const auto it = provisional_.find(id);
  if (it == provisional_.end()) return std::nullopt;
  return map_.world_from_pending(birth_keyframe(id)) * it->second.point_in_keyframe;
}

std::vector<std::optional<Eigen::Vector3d>> Tracker::positions(const std::vector<PointId>& points) const {
  std::vector<std::optional<Eigen::Vector3d>> result(points.size());
  for (size_t i = 0; i < points.size(); ++i)
    if (points[i] != kNoPoint) result[i] = position(points[i]);
  return result;
}

int Tracker::reference_point_count(KeyframeId reference) const {
  const Keyframe* k = map_.view().live_keyframe(reference);
  int count = 0;
  if (k == nullptr) {
    for (const auto& [id, p] : provisional_) count += birth_keyframe(id) == reference;
    return count;
  }
  const size_t observers = k->covisible.size() < 2 ? 1 : 2;  // where a map begins, little is seen twice yet
  for (PointId id : k->points)
    if (const MapPoint* p = map_.view().point(id)) count += p->observations.size() >= observers;
  return count;
}

void Tracker::reset_motion() {
  velocity_.reset();
  last_.reset();
  odometry_.clear();
  place_evidence_.clear();
  // A map whose first keyframe mapping has not answered for yet is a map.
  state_ = state_ != TrackingState::initialising || map_.view().keyframe_count() > 0 ? TrackingState::lost
                                                                                     : TrackingState::initialising;
}

Tracker::Pair Tracker::odometry_pair(int feature, const OdometryMatch& match, const Rigid3& cam_from_world) const {
  Pair pair{feature, match.point_in_world, kOdometryWeight, !match.guessed};
  if (match.guessed) pair.parallax_sigma = odometry_.parallax_sigma(match, last_->cam_from_world, cam_from_world);
  return pair;
}

PoseEstimate Tracker::refine(const Rigid3& initial, const std::vector<Pair>& pairs, const RgbdFeatures& features,
                             const std::optional<PosePrediction>& expected) const {
  std::vector<PoseObservation> observations;
  observations.reserve(pairs.size());
  for (const Pair& pair : pairs) {
    const Keypoint& k = features.keypoints[static_cast<size_t>(pair.feature)];
    PoseObservation o = pose_observation(k, pair.point_in_world, optics_);
    o.pixel_sigma = std::sqrt(optics_.corner_variance(k) + square(pair.parallax_sigma));
    o.weight = pair.weight;
    if (!pair.use_depth) o.depth = 0;
    observations.push_back(o);
  }
  if (!expected || !expected->weighs) return optimise_pose(optics_.camera, initial, observations);
  const PosePrior prior{expected->cam_from_world, inverse(expected->covariance)};
  const PoseEstimate estimate = optimise_pose(optics_.camera, initial, observations, {}, &prior);
  if (!expected->told || !estimate.by_observations || expected->allows(*estimate.by_observations)) return estimate;
  PoseEstimate alone = optimise_pose(optics_.camera, initial, observations);
  if (alone.ok) alone.by_observations = {alone.cam_from_world, inverse(alone.covariance)};
  return alone;
}

double Tracker::squared_error(const Pair& pair, const Rigid3& cam_from_world, const RgbdFeatures& features) const {
  const Keypoint& k = features.keypoints[static_cast<size_t>(pair.feature)];
  const Eigen::Vector2d at = optics_.camera.project(cam_from_world * pair.point_in_world);
  return (at - k.pixel.cast<double>()).squaredNorm() / (optics_.corner_variance(k) + square(pair.parallax_sigma));
}

// Visual-odometry points weigh little in a pose, and may be off by as much more: a shoe that goes 3 px a frame was
// within that. What has moved is told by what these points leave in this frame instead; it starts anew where it is now.
// Returns the limit, for squared errors over their variance.
double Tracker::forget_strays(const std::vector<Pair>& pairs, size_t first, const PoseEstimate& pose,
                              const RgbdFeatures& features, std::vector<std::optional<OdometryMatch>>& followed) const {
  std::vector<double> squares(pairs.size()), of_inliers;
  for (size_t i = first; i < pairs.size(); ++i) {
    if (!pose.inlier[i]) continue;
    squares[i] = squared_error(pairs[i], pose.cam_from_world, features);
    of_inliers.push_back(squares[i]);
  }
  if (of_inliers.empty()) return kChi2TwoDof95;
  const double limit = kStudent90 * variance_by_median(of_inliers);
  for (size_t i = first; i < pairs.size(); ++i)
    if (squares[i] > limit) followed[static_cast<size_t>(pairs[i].feature)].reset();
  return limit;
}

void Tracker::refresh_candidates(const std::vector<PointId>& points, double now) {
  if (!candidates_made_ || now - *candidates_made_ >= kRefreshAfter) {
    candidates_ = local_map_candidates(points, map_.view());
    for (Candidate& c : candidates_) c.established = established(c.id, now);
    candidates_made_ = now;
    from_view_ = candidates_.size();
  }
  candidates_.resize(from_view_);
  candidates_.reserve(from_view_ + provisional_.size());
  for (const auto& [id, p] : provisional_) {
    Candidate& c = candidates_.emplace_back();
    c.id = id;
    c.position = map_.world_from_pending(birth_keyframe(id)) * p.point_in_keyframe;
    c.normal.setZero();
    c.reference_distance = static_cast<float>(p.point_in_keyframe.norm());
    c.reference_scale = p.scale;
    c.descriptor = p.descriptor;
  }
}

// Per candidate: 1 = it is of `matched` (increasing) or was retracted.
std::vector<uint8_t> Tracker::candidates_to_skip(const std::vector<PointId>& matched) const {
  std::vector<uint8_t> skipped(candidates_.size(), 0);
  const auto skip = [&](size_t first, size_t end, const std::vector<PointId>& ids) {
    auto at = ids.begin();
    for (size_t i = first; i < end && at != ids.end(); ++i) {
      while (at != ids.end() && *at < candidates_[i].id) ++at;
      skipped[i] |= at != ids.end() && *at == candidates_[i].id;
    }
  };
  skip(0, from_view_, matched);
  skip(0, from_view_, retracted_);
  skip(from_view_, candidates_.size(), matched);
  return skipped;
}

// Keyframes of a map that was loaded are of another clock, and old.
bool Tracker::established(PointId id, double now) const {
  const MapPoint* p = map_.view().point(id);
  if (p == nullptr || p->observations.size() < 2) return false;
  const Keyframe& birth = *map_.view().keyframe(birth_keyframe(id));
  return birth.frame < 0 || birth.timestamp + kEstablishedAfter <= now;
}

// Features on movers that showed no well-known point end here: mapping never sees them.
void Tracker::drop_unmatched_suspects(TrackedFrame& frame) {
  frame.matched.clear();  // they are of all features
  frame.matched_in_world.clear();
  frame.source.clear();
  frame.source.reserve(frame.points.size());
  for (size_t f = 0; f < frame.points.size(); ++f)
    if (!frame.matchable().on_mover(f) || frame.points[f] != kNoPoint) frame.source.push_back(static_cast<int>(f));
  const size_t left = frame.source.size();
  if (left == frame.points.size()) return;
  frame.features = std::make_shared<const RgbdFeatures>(subset(*frame.features, frame.source));
  const auto keep = [&](auto& of_features) {
    for (size_t k = 0; k < left; ++k) of_features[k] = of_features[static_cast<size_t>(frame.source[k])];
    of_features.resize(left);
  };
  keep(frame.points), keep(frame.outlier), keep(frame.odometry), keep(frame.motion);
}

bool Tracker::track_local_map(const Rigid3& initial, double radius, int min_inliers, std::vector<PointId>& points,
                              TrackedFrame& frame, const std::function<bool(const PoseEstimate&)>& accept) {
  refresh_candidates(points, frame.timestamp);
  const RgbdFeatures& features = *frame.features;
  std::vector<uint8_t> taken(features.size(), 0);
  std::vector<PointId> matched;
  matched.reserve(features.size());
  for (size_t f = 0; f < points.size(); ++f)
    if (points[f] != kNoPoint) {
      taken[f] = 1;
      matched.push_back(points[f]);
    }
  radix_sort(matched);
  const std::vector<uint8_t> skipped = candidates_to_skip(matched);
  const ProjectionMatchOptions match{
      .radius = static_cast<float>(radius), .max_distance = kMatchDistance, .ratio = kMatchRatio};
  std::vector<Eigen::Vector3d> in_world(features.size(), Eigen::Vector3d::Zero());
  for (size_t f = 0; f < points.size(); ++f)
    if (points[f] != kNoPoint) in_world[f] = *position(points[f]);
  std::vector<uint8_t> visible(candidates_.size(), 0);
  const auto matches =
      match_by_projection(candidates_, frame.matchable(), optics_, initial, match, &taken, &visible, &skipped);
  for (const auto& m : matches) {
    const Candidate& c = candidates_[static_cast<size_t>(m.candidate)];
    points[static_cast<size_t>(m.feature)] = c.id;
    in_world[static_cast<size_t>(m.feature)] = c.position;
  }

  std::vector<Pair> pairs;
  pairs.reserve(features.size());
  for (size_t f = 0; f < points.size(); ++f)
    if (points[f] != kNoPoint) pairs.push_back({static_cast<int>(f), in_world[f]});
  const size_t in_map = pairs.size();
  std::vector<std::optional<OdometryMatch>> followed(features.size());
  if (last_) {
    for (const Pair& p : pairs) taken[static_cast<size_t>(p.feature)] = 1;
    const std::vector<Candidate> others = odometry_.candidates(*last_);
    for (const auto& m : match_by_projection(others, frame.matchable(), optics_, initial, match, &taken, nullptr)) {
      auto& shown = followed[static_cast<size_t>(m.feature)];
      shown = odometry_.match(static_cast<size_t>(m.candidate), *last_);
      if (!shown->moves) pairs.push_back(odometry_pair(m.feature, *shown, initial));
    }
  }
  const PoseEstimate pose = refine(initial, pairs, features, frame.predicted);
  if (!pose.ok) return false;
  const auto inliers = std::count(pose.inlier.begin(), pose.inlier.begin() + static_cast<long>(in_map), uint8_t{1});
  if (inliers < min_inliers || (accept && !accept(pose))) {
    frame.refused_inliers = std::max(frame.refused_inliers, static_cast<int>(inliers));
    return false;
  }

  const double limit = forget_strays(pairs, in_map, pose, features, followed);
  frame.in_view = std::move(matched);
  frame.in_view.reserve(frame.in_view.size() + candidates_.size());
  for (size_t i = 0; i < candidates_.size(); ++i)
    if (visible[i]) frame.in_view.push_back(candidates_[i].id);
  frame.found.clear();
  frame.found.reserve(features.size());
  frame.matched = points;
  frame.matched_in_world = std::move(in_world);
  frame.show_nothing();
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto f = static_cast<size_t>(pairs[i].feature);
    if (!pose.inlier[i]) {
      frame.outlier[f] = 1;
    } else if (i < in_map) {
      frame.points[f] = points[f];
      frame.found.push_back(points[f]);
    } else {
      frame.odometry[f] = followed[f];
    }
  }
  // A guessed depth is let pass more by the pose: the ray of the first sighting tells.
  for (size_t f = 0; f < followed.size(); ++f) {
    auto& shown = frame.odometry[f];
    if (followed[f] && followed[f]->moves) shown = followed[f];
    if (!shown || !shown->guessed) continue;
    shown->moves =
        shown->moves || odometry_.has_moved(*shown, features.keypoints[f], pose.cam_from_world, pose.covariance, limit);
    frame.outlier[f] = shown->moves;
  }
  frame.cam_from_world = pose.cam_from_world;
  frame.covariance = pose.covariance;
  frame.by_observations = pose.by_observations;
  frame.inliers = static_cast<int>(inliers);
  return true;
}

void Tracker::finish(TrackedFrame& frame) {
  visibility_.add_visible(std::exchange(frame.in_view, {}));
  visibility_.add_found(std::exchange(frame.found, {}));
  const std::vector<Covisible> observers = map_.view().observers_of(frame.points);
  KeyframeId reference = observers.empty() ? kNoKeyframe : observers.front().keyframe;
  // A keyframe that is still being mapped is the reference while most matches are its provisional points.
  std::map<KeyframeId, int> pending_votes;
  int lasting = 0;
  for (PointId p : frame.points) {
    if (p == kNoPoint) continue;
    const auto it = provisional_.find(p);
    if (it != provisional_.end())
      ++pending_votes[birth_keyframe(p)];
    else
      ++lasting;
  }
  const auto most = std::max_element(pending_votes.begin(), pending_votes.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most != pending_votes.end() && (reference == kNoKeyframe || most->second > lasting)) reference = most->first;
  // What this frame shows of the map may all have been taken out since: it hangs where the one before it does.
  if (reference == kNoKeyframe && last_) reference = last_->reference;
  frame.reference = reference;
  frame.cam_from_reference = frame.cam_from_world * map_.cam_from_world(reference).inverse();
}

// The velocity with the step to `frame` taken along. Over a short interval the step tells next to nothing of it.
VelocityFilter Tracker::velocity_by(const TrackedFrame& frame) const {
  VelocityFilter filter = velocity_.value_or(VelocityFilter{});
  // After a stretch without images the step holds what the prior was off by as well: its own velocity is better.
  if (last_->state == TrackingState::predicted) return filter;
  const double seconds = frame.timestamp - last_->timestamp;
  // What was predicted comes of this filter: it measures nothing.
  const bool expected = frame.predicted && frame.predicted->weighs;
  if (expected && !frame.by_observations) {
    filter.go_on(seconds);
    return filter;
  }
  const Rigid3& pose = expected ? frame.by_observations->cam_from_world : frame.cam_from_world;
  const Matrix6d covariance = expected ? inverse(frame.by_observations->information) : frame.covariance;
  filter.update(tangent_from_rigid3(pose * last_->cam_from_world.inverse()) / seconds,
                (covariance + last_->covariance) / (seconds * seconds), seconds);
  return filter;
}

// Features and pose as they are when the camera's motion within the image is known. The frame keeps what it has when
// that does not explain it: returns false.
bool Tracker::refine_at_velocity(const Vector6d& velocity, const FrameFeatures& made, TrackedFrame& frame) const {
  auto features = made.at(velocity);
  std::vector<Pair> pairs;
  pairs.reserve(frame.points.size());
  int in_map = 0;
  for (size_t f = 0; f < frame.points.size(); ++f)
    if (frame.points[f] != kNoPoint) {
      pairs.push_back({static_cast<int>(f), frame.matched_in_world[f]});
      ++in_map;
    }
  for (size_t f = 0; f < frame.points.size(); ++f)
    if (frame.odometry[f] && !frame.odometry[f]->moves)
      pairs.push_back(odometry_pair(static_cast<int>(f), *frame.odometry[f], frame.cam_from_world));
  const PoseEstimate pose = refine(frame.cam_from_world, pairs, *features, frame.predicted);
  if (!pose.ok) return false;
  const auto inliers = std::count(pose.inlier.begin(), pose.inlier.begin() + in_map, uint8_t{1});
  // Half as many vouch for a pose that was expected (track_expected).
  if (inliers < (frame.inliers < options_.min_inliers ? options_.min_inliers / 2 : options_.min_inliers)) return false;
  for (size_t i = 0; i < pairs.size(); ++i) {
    if (pose.inlier[i]) continue;
    const auto f = static_cast<size_t>(pairs[i].feature);
    frame.inliers -= frame.points[f] != kNoPoint;
    frame.points[f] = kNoPoint;
    frame.odometry[f].reset();
    frame.outlier[f] = 1;
  }
  frame.features = std::move(features);
  frame.cam_from_world = pose.cam_from_world;
  frame.covariance = pose.covariance;
  frame.by_observations = pose.by_observations;
  return true;
}

// `expected`: where to look first; may be null.
bool Tracker::relocalise(TrackedFrame& frame, PointAppearance* appearance, const PosePrediction* expected) {
  std::optional<PoseProposal> found;
  if (expected != nullptr) found = find_near(*expected, frame.matchable());
  if (!found) {
    found = relocaliser_.find(map_.view(), frame.matchable(), retracted_, appearance, place_evidence_);
    if (found) {
      frame.ambiguous = found->ambiguous || found->log_odds < 0;
      if (frame.ambiguous) return false;
    } else {
      found = find_where_lost(frame);
    }
    if (!found) return false;
  }
  candidates_made_.reset();
  if (frame.predicted) frame.predicted->weighs = false;
  const bool there = track_local_map(found->fit.cam_from_world, radius_local_map(), kMinRelocalisationInliers,
                                     found->fit.points, frame);
  if (!there) candidates_made_.reset();  // those around the place that was no place
  return there;
}

// The frame before was found in the map. It was seen without knowing how fast the camera moves, hence bent by the
// rolling shutter, and it may have been a mistake: it counts once this frame follows from it.
bool Tracker::confirm_relocalisation(TrackedFrame& frame, const TrackingInput& input) {
  if (!unconfirmed_) return false;
  const TrackingState before = state_;
  std::optional<PosedFrame> before_loss = std::exchange(last_, std::exchange(unconfirmed_, std::nullopt));
  state_ = TrackingState::tracking;
  candidates_made_.reset();
  if (frame.predicted) frame.predicted->weighs = false;  // it is of the way that this sighting contradicts
  if (last_->index + 1 == frame.index && track_from_last(frame, input)) return true;
  last_ = std::move(before_loss);
  state_ = before;
  candidates_made_.reset();  // those around the place that was no place
  return false;
}

TrackedFrame Tracker::track(const TrackingInput& input) {
  TrackedFrame frame;
  frame.index = input.index;
  frame.timestamp = input.timestamp;
  frame.features = input.features.at(velocity());
  frame.motion = input.features.motion;
  frame.motion.resize(frame.features->size(), FeatureMotion::still);
  frame.show_nothing();
  const MatchableFeatures matchable = frame.matchable();
  for (size_t f = 0; f < frame.features->size(); ++f)
    frame.with_depth += frame.features->keypoints[f].depth > 0 && !matchable.on_mover(f);

  const bool has_map = state_ != TrackingState::initialising;
  const auto predicted = frame.predicted = predict(input);
  const PosePrediction* expected = predicted ? &*predicted : suggested_ ? &*suggested_ : nullptr;
  bool followed = has_map && (track_from_last(frame, input) || (predicted && track_expected(*predicted, frame)) ||
                              track_among_suspects(frame, input));
  bool found_again = has_map && !followed && confirm_relocalisation(frame, input);
  if (has_map && !followed && !found_again && relocalise(frame, input.appearance, expected)) {
    // At once where it was expected, or where it is but a step from the frame before, if that one was seen; else when
    // the next frame agrees.
    const bool near = last_ && last_->index + 1 == frame.index && state_ == TrackingState::tracking &&
                      frame.timestamp - last_->timestamp <= kEvenMotion &&
                      possible_motion(frame.cam_from_world, frame.timestamp);
    followed = near || (expected != nullptr && expected->agrees(frame.cam_from_world));
    found_again = followed;
    if (!followed) {
      finish(frame);
      unconfirmed_ = frame;
      // The pose is not this frame's yet, and neither is what it explains.
      frame.show_nothing();
      odometry_.clear();         // they belong to the last frame, which the sighting will replace
      candidates_made_.reset();  // and these to the sighting
      go_on_unseen(predicted, input.step, frame);
      return frame;
    }
  }
  if (!followed && !found_again) {
    odometry_.clear();
    frame.starts_map = input.may_start_map && start_map(frame, predicted ? &*predicted : nullptr);
    if (!frame.starts_map) {
      go_on_unseen(predicted, input.step, frame);
      return frame;
    }
    frame.state = state_ = TrackingState::tracking;
    lost_.reset();
    suggested_.reset();
    last_ = frame;
    last_seen_ = frame.timestamp;
    return frame;
  }
  suggested_.reset();
  lost_.reset();
  unconfirmed_.reset();
  place_evidence_.clear();
  if (!last_ || frame.timestamp <= last_->timestamp) {
    velocity_.reset();
  } else {
    // The step just made tells the velocity half a frame ago; a share of its change brings it to now. The full half
    // would carry the noise of both steps into every feature.
    const Vector6d now = velocity_by(frame).velocity();
    const Vector6d change = velocity_ ? Vector6d(now - velocity_->velocity()) : Vector6d::Zero();
    if (input.start != nullptr && last_->starts_map) remake_start(input.start->at(now), frame);
    refine_at_velocity(now + kAccelerationShare * change, input.features, frame);
    if (last_->state != TrackingState::predicted && input.movers) leave_out_mover(input.features, frame);
    velocity_ = velocity_by(frame);
  }
  drop_unmatched_suspects(frame);
  finish(frame);
  frame.state = found_again ? TrackingState::relocalised : TrackingState::tracking;
  state_ = TrackingState::tracking;
  last_ = frame;
  last_seen_ = frame.timestamp;
  odometry_.remember(frame);
  return frame;
}

}  // namespace dkb
