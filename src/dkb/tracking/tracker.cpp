// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "dkb/matching/pose_observation.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

constexpr double kAccelerationShare = 0.25;  // chosen by measurement among 0, 0.25 and 0.5 (fr1_xyz)
constexpr double kGuessFactor = 2.0;         // on the noise of points at a guessed depth

}  // namespace

void TrackingOptions::check() const {
  require_option(initial_points >= 10, "initial_points", initial_points, "at least 10");
  require_option(min_matches >= 6, "min_matches", min_matches, "at least 6");
  require_option(min_inliers >= 6, "min_inliers", min_inliers, "at least 6");
  require_option(close_depth > 0, "close_depth", close_depth, "greater than 0 m");
  require_option(min_new_points >= 0, "min_new_points", min_new_points, "at least 0");
  require_option(radius_last_frame > 0, "radius_last_frame", radius_last_frame, "greater than 0 px");
  require_option(radius_wide > 0, "radius_wide", radius_wide, "greater than 0 px");
  require_option(radius_local_map > 0, "radius_local_map", radius_local_map, "greater than 0 px");
  require_option(odometry_sigma_factor == 0 || odometry_sigma_factor >= 1, "odometry_sigma_factor",
                 odometry_sigma_factor, "0 or at least 1");
  require_option(match_distance >= 0 && match_distance <= 256, "match_distance", match_distance, "0 ... 256 bits");
  require_option(match_ratio >= 0 && match_ratio <= 1, "match_ratio", match_ratio, "0 ... 1");
  require_option(established_frames >= 0, "established_frames", established_frames, "at least 0");
  require_option(refresh_frames >= 1, "refresh_frames", refresh_frames, "at least 1");
  require_option(new_map_after >= 0, "new_map_after", new_map_after, "at least 0 frames");
  local_map.check();
  relocalisation.check();
}

const char* name_of(TrackingState state) {
  switch (state) {
    case TrackingState::initialising:
      return "initialising";
    case TrackingState::tracking:
      return "tracking";
    case TrackingState::lost:
      return "lost";
    case TrackingState::relocalised:
      return "relocalised";
  }
  return "?";
}

Tracker::Tracker(const CameraModel& camera, const SensorNoise& noise, double scale_factor, int levels,
                 const TrackingOptions& options, uint64_t seed)
    : camera_(camera),
      noise_(noise),
      scale_factor_(scale_factor),
      levels_(levels),
      options_(options),
      seed_(seed),
      relocaliser_(camera, noise, scale_factor, levels, options.relocalisation, options.local_map, seed),
      view_(std::make_shared<const Map>()),
      odometry_(camera, scale_factor, options.close_depth) {
  options_.check();
  noise_.check();
}

Rigid3 Tracker::keyframe_pose(KeyframeId id) const {
  if (view_->keyframe(id) != nullptr) return view_->cam_from_world(id);
  for (const PendingKeyframe& p : pending_)
    if (p.id == id)
      return p.reference == kNoKeyframe ? p.cam_from_reference : p.cam_from_reference * keyframe_pose(p.reference);
  return {};
}

KeyframeId Tracker::root(KeyframeId id) const {
  while (view_->keyframe(id) == nullptr) {
    const auto pending = std::find_if(pending_.begin(), pending_.end(), [id](const auto& p) { return p.id == id; });
    if (pending == pending_.end() || pending->reference == kNoKeyframe) return id;
    id = pending->reference;
  }
  return view_->root(id);
}

Rigid3 Tracker::take_view(MapView view) {
  view_ = std::move(view);
  candidates_made_ = -1;
  std::erase_if(pending_, [&](const PendingKeyframe& p) { return view_->keyframe(p.id) != nullptr; });
  std::erase_if(provisional_, [&](const auto& p) { return view_->keyframe(p.second.keyframe) != nullptr; });
  std::erase_if(retracted_, [&](PointId id) {
    return view_->keyframe(birth_keyframe(id)) != nullptr && view_->point(id) == nullptr;
  });
  if (unconfirmed_) express_anew(*unconfirmed_);
  if (!last_) return {};
  return express_anew(*last_);
}

// A frame's pose and points by the view as it is now; how the world moved under its camera.
Rigid3 Tracker::express_anew(TrackedFrame& frame) const {
  const Rigid3 moved = frame.cam_from_reference * keyframe_pose(frame.reference);
  const Rigid3 new_world_from_old = moved.inverse() * frame.cam_from_world;
  frame.cam_from_world = moved;
  std::set<PointId> seen;  // two features may show points that have been fused since: the first keeps it
  for (PointId& p : frame.points) {
    if (p != kNoPoint && !provisional_.contains(p)) p = view_->resolve(p);
    if (p != kNoPoint && !seen.insert(p).second) p = kNoPoint;
  }
  return new_world_from_old;
}

Rigid3 Tracker::expected_motion(double seconds) const {
  if (!velocity_) return {};
  return rigid3_from_tangent(*velocity_ * seconds);
}

std::optional<Eigen::Vector3d> Tracker::position(PointId id) const {
  if (const MapPoint* p = view_->point(id)) return p->position;
  const auto it = provisional_.find(id);
  if (it == provisional_.end()) return std::nullopt;
  return keyframe_pose(it->second.keyframe).inverse() * it->second.point_in_keyframe;
}

int Tracker::reference_point_count(KeyframeId reference, int observers) const {
  const Keyframe* k = view_->live_keyframe(reference);
  int count = 0;
  if (k == nullptr) {
    for (const auto& [id, p] : provisional_) count += p.keyframe == reference;
    return count;
  }
  for (PointId id : k->points)
    if (const MapPoint* p = view_->point(id)) count += static_cast<int>(p->observations.size()) >= observers;
  return count;
}

void Tracker::reset_motion() {
  velocity_.reset();
  last_.reset();
  odometry_.clear();
  state_ = view_->keyframe_count() > 0 ? TrackingState::lost : TrackingState::initialising;
}

Tracker::Pair Tracker::odometry_pair(int feature, const OdometryMatch& match) const {
  return {feature, match.point_in_world, options_.odometry_sigma_factor * (match.guessed ? kGuessFactor : 1.0),
          !match.guessed};
}

PoseEstimate Tracker::refine(const Rigid3& initial, const std::vector<Pair>& pairs,
                             const RgbdFeatures& features) const {
  std::vector<PoseObservation> observations;
  observations.reserve(pairs.size());
  for (const Pair& pair : pairs) {
    PoseObservation o = pose_observation(features.keypoints[static_cast<size_t>(pair.feature)], pair.point_in_world,
                                         noise_, scale_factor_);
    o.pixel_sigma *= pair.sigma_factor;
    o.depth_sigma *= pair.sigma_factor;
    if (!pair.use_depth) o.depth = 0;
    observations.push_back(o);
  }
  return optimise_pose(camera_, initial, observations);
}

void Tracker::refresh_candidates(const std::vector<PointId>& points, FrameIndex index) {
  if (candidates_made_ >= 0 && index - candidates_made_ < options_.refresh_frames) return;
  candidates_ = local_map_candidates(points, *view_, options_.local_map);
  for (Candidate& c : candidates_) c.established = established(c.id, index);
  candidates_made_ = index;
}

bool Tracker::established(PointId id, FrameIndex now) const {
  const MapPoint* p = view_->point(id);
  if (p == nullptr || p->observations.size() < 2) return false;
  return view_->keyframe(birth_keyframe(id))->frame + options_.established_frames <= now;
}

// Features on movers that showed no well-known point end here: mapping never sees them.
void Tracker::drop_unmatched_suspects(TrackedFrame& frame) {
  frame.source.clear();
  for (size_t f = 0; f < frame.points.size(); ++f)
    if (!frame.features->keypoints[f].suspect || frame.points[f] != kNoPoint)
      frame.source.push_back(static_cast<int>(f));
  if (frame.source.size() == frame.points.size()) return;
  RgbdFeatures left = subset(*frame.features, frame.source);
  for (Keypoint& k : left.keypoints) k.suspect = false;
  frame.features = std::make_shared<const RgbdFeatures>(std::move(left));
  for (size_t k = 0; k < frame.source.size(); ++k) {
    frame.points[k] = frame.points[static_cast<size_t>(frame.source[k])];
    frame.outlier[k] = frame.outlier[static_cast<size_t>(frame.source[k])];
    frame.odometry[k] = frame.odometry[static_cast<size_t>(frame.source[k])];
  }
  frame.odometry.resize(frame.source.size());
  frame.points.resize(frame.source.size());
  frame.outlier.resize(frame.source.size());
}

bool Tracker::track_local_map(const Rigid3& initial, double radius, int min_inliers, std::vector<PointId>& points,
                              TrackedFrame& frame) {
  refresh_candidates(points, frame.index);
  const RgbdFeatures& features = *frame.features;
  std::vector<uint8_t> taken(features.size(), 0);
  std::vector<PointId> matched;
  for (size_t f = 0; f < points.size(); ++f)
    if (points[f] != kNoPoint) {
      taken[f] = 1;
      matched.push_back(points[f]);
    }
  std::sort(matched.begin(), matched.end());
  std::vector<Candidate> candidates;
  candidates.reserve(candidates_.size() + provisional_.size());
  const auto is_matched = [&](PointId id) { return std::binary_search(matched.begin(), matched.end(), id); };
  for (const Candidate& c : candidates_)
    if (!is_matched(c.id) && !is_retracted(c.id)) candidates.push_back(c);
  for (const auto& [id, p] : provisional_) {
    if (is_matched(id)) continue;
    Candidate c;
    c.id = id;
    c.position = *position(id);
    c.normal.setZero();
    c.reference_distance = static_cast<float>(p.point_in_keyframe.norm());
    c.reference_scale = p.scale;
    c.descriptor = p.descriptor;
    candidates.push_back(c);
  }
  ProjectionMatchOptions match;
  match.radius = static_cast<float>(radius);
  match.max_distance = options_.match_distance;
  match.ratio = static_cast<float>(options_.match_ratio);
  std::vector<uint8_t> visible(candidates.size(), 0);
  const auto matches =
      match_by_projection(candidates, features, camera_, initial, scale_factor_, levels_, match, &taken, &visible);
  for (const auto& m : matches)
    points[static_cast<size_t>(m.feature)] = candidates[static_cast<size_t>(m.candidate)].id;

  std::vector<Pair> pairs;
  for (size_t f = 0; f < points.size(); ++f)
    if (points[f] != kNoPoint) pairs.push_back({static_cast<int>(f), *position(points[f])});
  const size_t in_map = pairs.size();
  if (options_.odometry_sigma_factor > 0 && last_) {
    for (const Pair& p : pairs) taken[static_cast<size_t>(p.feature)] = 1;
    const std::vector<Candidate> others = odometry_.candidates(*last_);
    for (const auto& m :
         match_by_projection(others, features, camera_, initial, scale_factor_, levels_, match, &taken, nullptr)) {
      const auto c = static_cast<size_t>(m.candidate);
      pairs.push_back(odometry_pair(m.feature, {others[c].position, odometry_.guessed(c)}));
    }
  }
  const PoseEstimate pose = refine(initial, pairs, features);
  if (!pose.ok) return false;
  const auto inliers = std::count(pose.inlier.begin(), pose.inlier.begin() + static_cast<long>(in_map), uint8_t{1});
  if (inliers < min_inliers) return false;

  for (size_t i = 0; i < candidates.size(); ++i)
    if (visible[i]) ++visibility_[candidates[i].id].visible;
  for (PointId id : matched) ++visibility_[id].visible;
  // A guessed depth is let pass more; not where a mover may be.
  const auto strays = [&](const Pair& pair) {
    const Keypoint& k = features.keypoints[static_cast<size_t>(pair.feature)];
    if (pair.use_depth || !k.by_mover) return false;
    const double sigma = pose_observation(k, pair.point_in_world, noise_, scale_factor_).pixel_sigma;
    const Eigen::Vector2d seen = camera_.project(pose.cam_from_world * pair.point_in_world);
    return (seen - k.pixel.cast<double>()).squaredNorm() > PoseOptions().chi2_pixel * sigma * sigma;
  };
  frame.points.assign(points.size(), kNoPoint);
  frame.outlier.assign(points.size(), 0);
  frame.odometry.assign(points.size(), std::nullopt);
  for (size_t i = 0; i < pairs.size(); ++i) {
    const auto f = static_cast<size_t>(pairs[i].feature);
    if (!pose.inlier[i]) {
      frame.outlier[f] = 1;
    } else if (i < in_map) {
      frame.points[f] = points[f];
      ++visibility_[points[f]].found;
    } else if (strays(pairs[i])) {
      frame.outlier[f] = 1;
    } else {
      frame.odometry[f] = OdometryMatch{pairs[i].point_in_world, !pairs[i].use_depth};
    }
  }
  frame.cam_from_world = pose.cam_from_world;
  frame.covariance = pose.covariance;
  frame.inliers = static_cast<int>(inliers);
  return true;
}

void Tracker::finish(TrackedFrame& frame) {
  KeyframeId reference = keyframe_sharing_most(frame.points, *view_);
  // A keyframe that is still being mapped is the reference while most matches are its provisional points.
  std::map<KeyframeId, int> pending_votes;
  int lasting = 0;
  for (PointId p : frame.points) {
    if (p == kNoPoint) continue;
    const auto it = provisional_.find(p);
    if (it != provisional_.end())
      ++pending_votes[it->second.keyframe];
    else
      ++lasting;
  }
  for (const auto& [keyframe, votes] : pending_votes)
    if (reference == kNoKeyframe || votes > lasting) reference = keyframe;
  frame.reference = reference;
  frame.cam_from_reference = frame.cam_from_world * keyframe_pose(reference).inverse();
}

Vector6d Tracker::velocity_to(const TrackedFrame& frame) const {
  const Rigid3 step = frame.cam_from_world * last_->cam_from_world.inverse();
  Vector6d tangent;
  tangent << step.translation, vector_from_rotation(step.rotation);
  return tangent / (frame.timestamp - last_->timestamp);
}

// Features and pose as they are when the camera's motion within the image is known. The frame keeps what it has when
// that does not explain it.
void Tracker::refine_at_velocity(const Vector6d& velocity, const FeaturesAt& features_at, TrackedFrame& frame) const {
  auto features = features_at(velocity);
  std::vector<Pair> pairs;
  int in_map = 0;
  for (size_t f = 0; f < frame.points.size(); ++f)
    if (frame.points[f] != kNoPoint) {
      pairs.push_back({static_cast<int>(f), *position(frame.points[f])});
      ++in_map;
    }
  for (size_t f = 0; f < frame.points.size(); ++f)
    if (frame.odometry[f]) pairs.push_back(odometry_pair(static_cast<int>(f), *frame.odometry[f]));
  const PoseEstimate pose = refine(frame.cam_from_world, pairs, *features);
  if (!pose.ok) return;
  const auto inliers = std::count(pose.inlier.begin(), pose.inlier.begin() + in_map, uint8_t{1});
  if (inliers < options_.min_inliers) return;
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
}

// Similar rooms are told apart by how far the camera can have moved since it was lost.
bool Tracker::within_travel_distance(const PoseProposal& found, double timestamp) const {
  if (!last_) return true;
  if (root(last_->reference) != root(found.keyframe)) return false;
  const RelocalisationOptions& o = options_.relocalisation;
  const double distance = (centre_in_world(found.cam_from_world) - centre_in_world(last_->cam_from_world)).norm();
  return distance <= o.max_distance + o.max_speed * (timestamp - last_->timestamp);
}

bool Tracker::relocalise(TrackedFrame& frame, const LooksTheSame& looks_the_same) {
  auto found = relocaliser_.find(
      *view_, *frame.features, [this](PointId id) { return is_retracted(id); }, looks_the_same);
  if (!found) return false;
  if (!within_travel_distance(*found, frame.timestamp) &&
      found->similarity() < options_.relocalisation.min_similarity_far)
    return false;
  candidates_made_ = -1;
  return track_local_map(found->cam_from_world, options_.radius_local_map, options_.relocalisation.min_inliers,
                         found->points, frame);
}

// The frame before was found in the map. It was seen without knowing how fast the camera moves, hence bent by the
// rolling shutter, and it may have been a mistake: it counts once this frame follows from it.
bool Tracker::confirm_relocalisation(TrackedFrame& frame) {
  if (!unconfirmed_) return false;
  std::optional<TrackedFrame> before_loss = std::exchange(last_, std::exchange(unconfirmed_, std::nullopt));
  state_ = TrackingState::tracking;
  candidates_made_ = -1;
  if (last_->index + 1 == frame.index && track_from_last(frame)) return true;
  last_ = std::move(before_loss);
  state_ = TrackingState::lost;
  return false;
}

// A map starts where enough depth is in view: the first at once, another one when the old one stays out of sight.
bool Tracker::start_map(TrackedFrame& frame) {
  int with_depth = 0;
  for (const Keypoint& k : frame.features->keypoints) with_depth += k.depth > 0 && !k.suspect;
  if (with_depth < options_.initial_points) return false;
  if (state_ == TrackingState::lost && (options_.new_map_after == 0 || ++lost_frames_ < options_.new_map_after))
    return false;
  frame.inliers = with_depth;
  frame.cam_from_world = last_ ? last_->cam_from_world : start_;
  drop_unmatched_suspects(frame);
  candidates_made_ = -1;
  velocity_.reset();
  return true;
}

TrackOutcome Tracker::track(FrameIndex index, double timestamp, const FeaturesAt& features_at, bool may_start_map,
                            const LooksTheSame& looks_the_same) {
  TrackOutcome outcome;
  TrackedFrame& frame = outcome.frame;
  frame.index = index;
  frame.timestamp = timestamp;
  frame.features = features_at(velocity());
  const size_t n = frame.features->size();
  frame.points.assign(n, kNoPoint);
  frame.outlier.assign(n, 0);
  frame.odometry.assign(n, std::nullopt);

  const bool has_map = state_ != TrackingState::initialising;
  bool followed = has_map && track_from_last(frame);
  bool found_again = has_map && !followed && confirm_relocalisation(frame);
  if (has_map && !followed && !found_again && relocalise(frame, looks_the_same)) {
    // At once where the motion from the frame before is plausible; else when the next frame agrees.
    followed = moved_plausibly_from_last(frame);
    found_again = followed;
    if (!followed) {
      finish(frame);
      unconfirmed_ = frame;
      odometry_.clear();  // they belong to the last frame, which this one replaces once confirmed
      outcome.state = state_ = TrackingState::lost;
      velocity_.reset();
      return outcome;
    }
  }
  if (!followed && !found_again) {
    if (has_map) state_ = TrackingState::lost;
    velocity_.reset();
    odometry_.clear();
    outcome.wants_first_keyframe = may_start_map && start_map(frame);
    if (outcome.wants_first_keyframe) {
      state_ = TrackingState::tracking;
      lost_frames_ = 0;
      last_ = frame;
    }
    outcome.state = state_;
    return outcome;
  }
  lost_frames_ = 0;
  unconfirmed_.reset();
  if (!last_ || timestamp <= last_->timestamp) {
    velocity_.reset();
  } else {
    // The step just made tells the velocity half a frame ago; a share of its change since the step before brings it to
    // now. The full half would carry the noise of both steps into every feature.
    const Vector6d step = velocity_to(frame);
    const Vector6d before = velocity_.value_or(step);
    refine_at_velocity(step + kAccelerationShare * (step - before), features_at, frame);
    velocity_ = velocity_to(frame);
  }
  drop_unmatched_suspects(frame);
  finish(frame);
  outcome.state = found_again ? TrackingState::relocalised : TrackingState::tracking;
  state_ = TrackingState::tracking;
  last_ = frame;
  odometry_.remember(frame);
  return outcome;
}

}  // namespace dkb
