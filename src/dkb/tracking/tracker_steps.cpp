// SPDX-License-Identifier: Apache-2.0
// From the last frame to this one.
#include <algorithm>
#include <utility>

#include "dkb/matching/pose_observation.h"
#include "dkb/solver/second_motion.h"
#include "dkb/tracking/tracker.h"
#include "dkb/util/chi_square.h"

namespace dkb {
namespace {

// What the camera may do between two frames; beyond it the pose is a mistake, or the camera is to be sought. Ten times
// a brisk walk, and twice the fastest turn of a head.
constexpr double kMaxVelocity = 15;         // [m/s]
constexpr double kMaxAngularVelocity = 15;  // [rad/s]

constexpr double kRadiusLastFrame = 10.0;  // [px] search around the motion model's prediction
constexpr double kRadiusWide = 30.0;       // [px] the same around the last pose
constexpr int kMinMatches = 20;            // with the last frame that make a pose worth trying

}  // namespace

std::optional<Rigid3> Tracker::track_last_frame(const Rigid3& predicted, double radius,
                                                const MatchableFeatures& features, std::vector<PointId>& points) const {
  std::vector<Candidate> candidates;
  candidates.reserve(last_->points.size());
  // What was seen last may have been seen from elsewhere: scale and orientation are of that view.
  const Eigen::Vector3d centre = centre_in_world(last_->seen_cam_from_cam * last_->cam_from_world);
  const bool seen_from_here = last_->state != TrackingState::predicted;
  for (size_t f = 0; f < last_->points.size(); ++f) {
    const PointId id = last_->points[f];
    if (id == kNoPoint || is_retracted(id)) continue;
    const auto at = position(id);
    if (!at) continue;
    Candidate c = candidate_of(*last_->features, f, *at, (*at - centre).norm(), optics_.scale_factor);
    c.id = id;
    if (!seen_from_here) c.angle = -1;
    c.established = established(id, last_->timestamp);
    candidates.push_back(c);
  }
  ProjectionMatchOptions match;
  match.radius = static_cast<float>(radius);
  match.max_distance = kMatchDistance;
  match.ratio = 0.9f;
  const auto matches = match_by_projection(candidates, features, optics_, predicted, match, nullptr, nullptr);
  if (static_cast<int>(matches.size()) < kMinMatches) return std::nullopt;
  std::vector<Pair> pairs;
  pairs.reserve(matches.size());
  for (const auto& m : matches) pairs.push_back({m.feature, candidates[static_cast<size_t>(m.candidate)].position});
  // It need only say where the map is to be searched.
  const PoseEstimate pose = refine(predicted, pairs, features.features, {}, {.tail_rounds = 0});
  if (!pose.ok || pose.inliers < kMinMatches / 2) return std::nullopt;
  for (size_t i = 0; i < matches.size(); ++i)
    if (pose.inlier[i])
      points[static_cast<size_t>(matches[i].feature)] = candidates[static_cast<size_t>(matches[i].candidate)].id;
  return pose.cam_from_world;
}

// By descriptors alone, for a camera whose motion is not known or not what was expected: in a fast turn a search around
// the last place of each point finds just enough wrong ones for a wrong pose.
std::optional<Rigid3> Tracker::match_last_frame(const TrackedFrame& frame, std::vector<PointId>& points) const {
  std::vector<Candidate> known;
  for (size_t f = 0; f < last_->points.size(); ++f) {
    const PointId id = last_->points[f];
    if (id == kNoPoint || is_retracted(id)) continue;
    const auto at = position(id);
    if (!at) continue;
    Candidate& k = known.emplace_back();
    k.id = id;
    k.position = *at;
    k.descriptor = last_->features->descriptors[f];
  }
  auto found = fit_by_descriptors(known, frame.matchable(), optics_, kMinMatches, {.seed = seed_});
  if (!found || found->inliers < kMinMatches || !plausible_motion(found->cam_from_world, frame.timestamp))
    return std::nullopt;
  points = std::move(found->points);
  return found->cam_from_world;
}

// Where the camera is expected: by what is known of the step where there is anything, else by the motion so far.
std::vector<Rigid3> Tracker::expected_poses(double dt, const TrackingInput& input) const {
  std::vector<Rigid3> steps;
  if (input.step != nullptr) steps.push_back(input.step->previous_from_current.inverse());
  if (velocity_) steps.push_back(expected_motion(dt));
  for (Rigid3& step : steps) step = step * last_->cam_from_world;
  return steps;
}

bool Tracker::track_from_last(TrackedFrame& frame, const TrackingInput& input) {
  if (state_ == TrackingState::lost || !last_) return false;
  const MatchableFeatures features = frame.matchable();
  std::vector<PointId> points(frame.points.size(), kNoPoint);
  std::optional<Rigid3> pose;
  for (const Rigid3& expected : expected_poses(frame.timestamp - last_->timestamp, input))
    if (!pose) pose = track_last_frame(expected, search_radius(kRadiusLastFrame), features, points);
  const auto shown = [](const std::vector<PointId>& of) {
    return std::count_if(of.begin(), of.end(), [](PointId p) { return p != kNoPoint; });
  };
  const auto surface = [&](const std::vector<PointId>& of, const Rigid3& from) {
    double sum = 0;
    for (PointId id : of)
      if (id != kNoPoint) sum += surface_around((from * *position(id)).z());
    return sum;
  };
  // Where little of what was shown is found where it is expected, it may be elsewhere.
  if (!pose || 4 * shown(points) < shown(last_->points)) {
    std::vector<PointId> elsewhere(frame.points.size(), kNoPoint);
    const std::optional<Rigid3> other = match_last_frame(frame, elsewhere);
    if (other && (!pose || surface(elsewhere, *other) > surface(points, *pose))) {
      pose = other;
      points = std::move(elsewhere);
      if (frame.predicted && !frame.predicted->agrees(*pose)) frame.predicted->weighs = false;
    }
  }
  if (!pose) pose = track_last_frame(last_->cam_from_world, kRadiusWide, features, points);
  if (!pose && map_.view().live_keyframe(last_->reference) != nullptr) {
    // Without the motion: the camera cannot be far from what it saw last.
    auto near = relocaliser_.propose_from(map_.view(), last_->reference, features,
                                          [this](PointId id) { return is_retracted(id); });
    if (near && plausible_motion(near->fit.cam_from_world, frame.timestamp)) {
      pose = near->fit.cam_from_world;
      points = std::move(near->fit.points);
    }
  }
  if (pose && track_local_map(*pose, kRadiusLocalMap, options_.min_inliers, points, frame)) return true;
  return frame.predicted && track_expected(*frame.predicted, frame);
}

// Where something else says where the camera is, fewer points need vouch for it: half as many, if they agree with what
// is expected and most of what matches agrees with them. Down a blank corridor they are what holds the camera.
bool Tracker::track_expected(const PosePrediction& expected, TrackedFrame& frame) {
  const auto agrees = [&](const PoseEstimate& pose) {
    return 2 * static_cast<size_t>(pose.inliers) > pose.inlier.size() && expected.agrees(pose.cam_from_world);
  };
  refresh_candidates(last_->points, frame.timestamp);  // of no matches there would be none
  // Of places that look alike the nearest to the expected one is meant: the search starts there and widens.
  const double reach = std::min(kMaxSearchRadius, kRadiusLocalMap + spread_px(expected.covariance));
  for (double radius = kRadiusLocalMap; radius < 2 * reach; radius *= 2) {
    std::vector<PointId> points(frame.points.size(), kNoPoint);
    if (track_local_map(expected.cam_from_world, std::min(radius, reach), options_.min_inliers / 2, points, frame,
                        agrees))
      return true;
  }
  return false;
}

// Somebody whose points the map holds as still walks off: one motion does not explain all matches. The pose is then by
// those of the camera's own motion.
void Tracker::leave_out_mover(const FrameFeatures& features, TrackedFrame& frame) const {
  std::vector<size_t> matched;
  std::vector<PoseObservation> observations;
  for (size_t f = 0; f < frame.matched.size(); ++f) {
    if (frame.matched[f] == kNoPoint) continue;
    matched.push_back(f);
    observations.push_back(pose_observation(frame.features->keypoints[f], *position(frame.matched[f]), optics_));
  }
  const auto moves = second_motion(optics_.camera, frame.cam_from_world, observations, options_.min_inliers);
  if (!moves) return;
  TrackedFrame by_still = frame;
  by_still.inliers = static_cast<int>(std::count(moves->begin(), moves->end(), 0));
  if (by_still.predicted) by_still.predicted->weighs = false;  // the surfaces that it comes from are his as well
  for (size_t i = 0; i < matched.size(); ++i) {
    by_still.points[matched[i]] = (*moves)[i] ? kNoPoint : frame.matched[matched[i]];
    by_still.outlier[matched[i]] = (*moves)[i];
  }
  // So are some of the points that are followed from frame to frame: those that fit are the room's.
  const auto followed =
      std::exchange(by_still.odometry, std::vector<std::optional<OdometryMatch>>(frame.odometry.size()));
  if (!refine_at_velocity(velocity_to(frame), features, by_still)) return;
  for (size_t f = 0; f < followed.size(); ++f) {
    if (!followed[f]) continue;
    const Pair pair = odometry_pair(static_cast<int>(f), *followed[f], by_still.cam_from_world);
    if (followed[f]->moves || squared_error(pair, by_still.cam_from_world, *by_still.features) <= kChi2TwoDof95)
      by_still.odometry[f] = followed[f];
  }
  frame = std::move(by_still);
}

bool Tracker::plausible_motion(const Rigid3& cam_from_world, double timestamp) const {
  const Rigid3 motion = cam_from_world * last_->cam_from_world.inverse();
  const double seconds = timestamp - last_->timestamp;
  return motion.translation.norm() <= kMaxVelocity * seconds &&
         vector_from_rotation(motion.rotation).norm() <= kMaxAngularVelocity * seconds;
}

bool Tracker::moved_plausibly_from_last(const TrackedFrame& frame) const {
  return last_ && last_->index + 1 == frame.index && state_ != TrackingState::lost &&
         plausible_motion(frame.cam_from_world, frame.timestamp);
}

}  // namespace dkb
