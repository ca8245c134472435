// SPDX-License-Identifier: Apache-2.0
// From the last frame to this one.
#include <algorithm>
#include <utility>

#include "dkb/solver/second_motion.h"
#include "dkb/tracking/tracker.h"

namespace dkb {
namespace {

// What the camera may do between two frames; beyond it the pose is a mistake, or the camera is to be sought. Ten times
// a brisk walk, and twice the fastest turn of a head.
constexpr double kMaxVelocity = 15;         // [m/s]
constexpr double kMaxAngularVelocity = 15;  // [rad/s]

constexpr int kMinMatches = 20;  // with the last frame that make a pose worth trying

}  // namespace

// The map points that the last frame showed, as they looked there.
std::vector<Candidate> Tracker::points_shown_last() const {
  std::vector<Candidate> shown;
  shown.reserve(last_->points.size());
  // What was seen last may have been seen from elsewhere: scale and orientation are of that view.
  const Eigen::Vector3d centre = centre_in_world(last_->seen_cam_from_cam * last_->cam_from_world);
  const bool seen_from_here = last_->state != TrackingState::predicted;
  for (size_t f = 0; f < last_->points.size(); ++f) {
    const PointId id = last_->points[f];
    if (id == kNoPoint || is_retracted(id)) continue;
    const auto at = position(id);
    if (!at) continue;
    Candidate c = candidate_of(*last_->features, f, *at, (*at - centre).norm(), optics_);
    c.id = id;
    if (!seen_from_here) c.angle = -1;
    c.established = established(id, last_->timestamp);
    shown.push_back(c);
  }
  return shown;
}

bool Tracker::track_from_last(TrackedFrame& frame, const TrackingInput& input) {
  if (state_ == TrackingState::lost || !last_) return false;
  const MatchableFeatures features = frame.matchable();
  const std::vector<Candidate> shown = points_shown_last();
  // It need only say where the map is to be searched.
  const auto fit_near = [&](const Rigid3& expected, double radius) {
    const float radii[] = {static_cast<float>(radius)};
    return fit_by_projection(shown, features, optics_, expected, radii,
                             {.match = {.max_distance = kMatchDistance, .ratio = 0.9f},
                              .min_matches = kMinMatches,
                              .pose = {.tail_rounds = 0, .min_inliers = kMinMatches / 2}});
  };
  // By what is known of the step where there is anything, then by the motion so far.
  std::optional<PlaceFit> fit;
  const double usual = radius_last_frame();
  const double radius = last_->state == TrackingState::predicted ? reach_px(usual, last_->covariance) : usual;
  if (input.step != nullptr)
    fit = fit_near(input.step->previous_from_current.inverse() * last_->cam_from_world, radius);
  if (!fit && velocity_)
    fit = fit_near(
        rigid3_from_tangent(velocity_->velocity() * (frame.timestamp - last_->timestamp)) * last_->cam_from_world,
        radius);
  const auto surface = [&](const PlaceFit& of) {
    double sum = 0;
    for (PointId id : of.points)
      if (id != kNoPoint) sum += surface_around((of.cam_from_world * *position(id)).z());
    return sum;
  };
  // Where little of what was shown is found where it is expected, it may be elsewhere. By descriptors alone, since in a
  // fast turn a search around the last place of each point finds just enough wrong ones for a wrong pose.
  if (!fit || 4 * static_cast<size_t>(fit->inliers) < shown.size()) {
    auto other = fit_by_descriptors(shown, features, optics_, kMinMatches, {.seed = seed_});
    if (other && other->inliers >= kMinMatches && possible_motion(other->cam_from_world, frame.timestamp) &&
        (!fit || surface(*other) > surface(*fit))) {
      fit = std::move(other);
      if (frame.predicted && !frame.predicted->agrees(fit->cam_from_world)) frame.predicted->weighs = false;
    }
  }
  if (!fit) {
    fit = fit_near(last_->cam_from_world, 3 * usual);
    if (fit && !plausible_motion(fit->cam_from_world, frame.timestamp)) fit.reset();
  }
  if (!fit && map_.view().live_keyframe(last_->reference) != nullptr) {
    // Without the motion: the camera cannot be far from what it saw last.
    auto near = relocaliser_.propose_from(map_.view(), last_->reference, features, retracted_);
    if (near && plausible_motion(near->fit.cam_from_world, frame.timestamp)) fit = std::move(near->fit);
  }
  return fit && track_local_map(fit->cam_from_world, radius_local_map(), options_.min_inliers, fit->points, frame);
}

// Depth that was aligned wrongly takes the room for moved and leaves nothing to track by, most of all between the first
// two frames, when no velocity is known. What the last frame showed of the map is then sought among all features:
// nobody who moves is in the map, but for who stood still when he came into it, and he is found as a second motion.
bool Tracker::track_among_suspects(TrackedFrame& frame, const TrackingInput& input) {
  if (std::find(frame.motion.begin(), frame.motion.end(), FeatureMotion::on_mover) == frame.motion.end()) return false;
  auto told = std::exchange(frame.motion, std::vector<FeatureMotion>(frame.motion.size(), FeatureMotion::still));
  const bool followed = track_from_last(frame, input);
  frame.motion = std::move(told);
  return followed;
}

// Where something else says where the camera is, fewer points need vouch for it: half as many, if they agree with what
// is expected and most of what matches agrees with them. Down a blank corridor they are what holds the camera.
bool Tracker::track_expected(const PosePrediction& expected, TrackedFrame& frame) {
  const auto agrees = [&](const PoseEstimate& pose) {
    return 2 * static_cast<size_t>(pose.inliers) > pose.inlier.size() && expected.agrees(pose.cam_from_world);
  };
  refresh_candidates(last_->points, frame.timestamp);  // of no matches there would be none
  for (const double radius : widening_radii(expected.covariance)) {
    std::vector<PointId> points(frame.points.size(), kNoPoint);
    if (track_local_map(expected.cam_from_world, radius, options_.min_inliers / 2, points, frame, agrees)) return true;
  }
  return false;
}

bool Tracker::possible_motion(const Rigid3& cam_from_world, double timestamp) const {
  const Rigid3 motion = cam_from_world * last_->cam_from_world.inverse();
  const double seconds = timestamp - last_->timestamp;
  return motion.translation.norm() <= kMaxVelocity * seconds &&
         vector_from_rotation(motion.rotation).norm() <= kMaxAngularVelocity * seconds;
}

// For what is sought around the last place or from the reference keyframe: somebody before the lens leaves few matches,
// and some of them may agree on a place where no hand takes a camera.
bool Tracker::plausible_motion(const Rigid3& cam_from_world, double timestamp) const {
  if (const auto expected = pose_by_velocity(timestamp)) return expected->agrees(cam_from_world);
  return possible_motion(cam_from_world, timestamp);
}

}  // namespace dkb
