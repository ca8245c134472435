// SPDX-License-Identifier: Apache-2.0
// What a motion prior tells when the images do not: where the camera is by now, and where it is to be sought.
#include <algorithm>
#include <cmath>

#include "dkb/geometry/decompositions.h"
#include "dkb/tracking/tracker.h"
#include "dkb/util/chi_square.h"

namespace dkb {
namespace {

// Standard deviations of a place that nothing but the camera tells, beyond which nobody knows it.
constexpr double kMaxGuessedPosition = 0.25;  // [m]
constexpr double kMaxGuessedRotation = 0.25;  // [rad]

// What a pose by the images may be off beside the prior: a relocaliser's, with the rolling shutter not yet modelled.
constexpr double kFoundPositionSd = 0.02;  // [m]
constexpr double kFoundRotationSd = 0.01;  // [rad]

constexpr size_t kKeyframesNearby = 3;    // that an expected pose is sought from
constexpr double kMaxViewDistance = 3.0;  // [m] between cameras that may show the same ...
constexpr double kMaxViewAngle = 1.0;     // [rad] ... and between their axes: about the field of view

// Whether two poses may be the same one, by the covariance of what is between them: a right perturbation of
// world_from_cam.
bool may_be_one(const Rigid3& cam_from_world, const Rigid3& other, const Matrix6d& covariance) {
  const Vector6d delta = tangent_from_rigid3(cam_from_world * other.inverse());
  return delta.dot(solve_symmetric(covariance, delta)) <= kChi2SixDof99;
}

}  // namespace

std::optional<MotionPrior> Tracker::expected_step(double timestamp, const MotionPrior* prior) const {
  if (!last_ || timestamp <= last_->timestamp) return std::nullopt;  // stamps may differ by less than a double tells
  if (state_ == TrackingState::lost) prior = nullptr;  // it tells of the step from a frame whose pose nobody knows
  if (prior != nullptr && !prior->rotation_only) return *prior;
  MotionPrior step;
  const double seconds = timestamp - last_->timestamp;
  const VelocityFilter filter = velocity_.value_or(VelocityFilter{});
  step.previous_from_current = rigid3_from_tangent(filter.velocity() * seconds).inverse();
  step.covariance = seconds * seconds * filter.covariance(last_->timestamp - last_seen_, timestamp - last_seen_);
  if (prior == nullptr) return step;
  // Nothing corrects the translation.
  const auto off = [](double t) { return position_change_sd(t) * position_change_sd(t); };
  double variance = off(timestamp - last_seen_) - off(last_->timestamp - last_seen_);
  if (!velocity_) variance += seconds * seconds * kSpeedSd * kSpeedSd;
  step.covariance = Vector6d::Constant(variance).asDiagonal();
  step.previous_from_current.rotation = prior->previous_from_current.rotation;
  step.covariance.bottomRightCorner<3, 3>() = prior->covariance.bottomRightCorner<3, 3>();
  return step;
}

PosePrediction Tracker::pose_after(const MotionPrior& step) const {
  const MotionPrior whole = joined({last_->cam_from_world.inverse(), false, last_->covariance}, step);
  return {whole.previous_from_current.inverse(), whole.covariance};
}

std::optional<PosePrediction> Tracker::pose_by_velocity(double timestamp) const {
  const auto step = velocity_ ? expected_step(timestamp, nullptr) : std::nullopt;
  if (!step) return std::nullopt;
  return pose_after(*step);
}

std::optional<PosePrediction> Tracker::predict(const TrackingInput& input) const {
  if (input.step == nullptr || !last_ || last_->index + 1 != input.index || state_ == TrackingState::lost)
    return std::nullopt;
  const bool bridges = input.prior != nullptr && !input.prior->rotation_only;
  PosePrediction pose = pose_after(*input.step);
  const Vector6d variance = pose.covariance.diagonal();
  const bool known = variance.head<3>().maxCoeff() <= kMaxGuessedPosition * kMaxGuessedPosition &&
                     variance.tail<3>().maxCoeff() <= kMaxGuessedRotation * kMaxGuessedRotation;
  if (!(bridges || known) || !possible_motion(pose.cam_from_world, input.timestamp)) return std::nullopt;
  pose.weighs = true;
  pose.told = input.prior != nullptr;
  return pose;
}

bool PosePrediction::allows(const PosePrior& by_observations) const {
  return may_be_one(cam_from_world, by_observations.cam_from_world, covariance + inverse(by_observations.information));
}

bool PosePrediction::agrees(const Rigid3& found_cam_from_world) const {
  Matrix6d sum = covariance;
  sum.diagonal().head<3>().array() += kFoundPositionSd * kFoundPositionSd;
  sum.diagonal().tail<3>().array() += kFoundRotationSd * kFoundRotationSd;
  return may_be_one(cam_from_world, found_cam_from_world, sum);
}

// The frame has no pose by its images: the predicted one stands in where there is one, and the next frame goes on from
// it.
void Tracker::go_on_unseen(const std::optional<PosePrediction>& prediction, const MotionPrior* told,
                           TrackedFrame& frame) {
  if (!prediction) {
    velocity_.reset();
    if (state_ != TrackingState::initialising) state_ = TrackingState::lost;
    frame.state = state_;
    return;
  }
  frame.state = state_ = TrackingState::predicted;
  frame.cam_from_world = prediction->cam_from_world;
  frame.covariance = prediction->covariance;
  frame.reference = last_->reference;
  frame.cam_from_reference = frame.cam_from_world * map_.cam_from_world(frame.reference).inverse();
  const Rigid3 step = frame.cam_from_world * last_->cam_from_world.inverse();
  const double seconds = frame.timestamp - last_->timestamp;
  velocity_ = VelocityFilter(tangent_from_rigid3(step) / seconds, told->covariance / (seconds * seconds));
  // What was seen last is still what the camera may see next.
  last_->seen_cam_from_cam = last_->seen_cam_from_cam * step.inverse();
  last_->index = frame.index;
  last_->timestamp = frame.timestamp;
  last_->cam_from_world = frame.cam_from_world;
  last_->cam_from_reference = frame.cam_from_reference;
  last_->covariance = frame.covariance;
  last_->state = frame.state;
}

// [px] `radius`, and three standard deviations of where a pose of that covariance puts a point 1 m away, nearer than
// most.
double Tracker::reach_px(double radius, const Matrix6d& covariance) const {
  const auto sd = covariance.diagonal().cwiseMax(0).cwiseSqrt();
  const double spread = 3 * optics_.camera.fx * (sd.head<2>().maxCoeff() + sd.tail<3>().head<2>().maxCoeff());
  // Beyond, nearly everything is a candidate of everything.
  return std::min(6 * radius_last_frame(), radius + spread);
}

// [px] Of places that look alike the nearest to the expected one is meant: the search starts there and widens.
std::vector<double> Tracker::widening_radii(const Matrix6d& covariance) const {
  const double reach = reach_px(radius_local_map(), covariance);
  std::vector<double> radii;
  for (double radius = radius_local_map(); radius < 2 * reach; radius *= 2) radii.push_back(std::min(radius, reach));
  return radii;
}

// The keyframes whose cameras stand nearest to the expected one and look the same way.
std::optional<PoseProposal> Tracker::find_near(const PosePrediction& expected,
                                               const MatchableFeatures& features) const {
  const Eigen::Vector3d centre = centre_in_world(expected.cam_from_world);
  const double reach = kMaxViewDistance + 3 * std::sqrt(expected.covariance.topLeftCorner<3, 3>().trace());
  std::vector<std::pair<double, KeyframeId>> nearby;
  // Worlds of maps that are not joined have nothing to do with each other.
  const bool one_map = !last_ || map_.view().roots().size() < 2;
  const KeyframeId root = one_map ? kNoKeyframe : map_.root(last_->reference);
  const std::vector<KeyframeId> root_of = one_map ? std::vector<KeyframeId>() : map_.view().root_of_each();
  for (KeyframeId id : map_.view().live_keyframes()) {
    if (!one_map && root_of[static_cast<size_t>(id)] != root) continue;
    const Rigid3& k = map_.view().keyframe(id)->cam_from_world;
    const double distance = (centre_in_world(k) - centre).norm();
    const Eigen::Vector3d axis = (expected.cam_from_world.rotation * k.rotation.conjugate()) * Eigen::Vector3d::UnitZ();
    const double angle = std::acos(std::clamp(axis.z(), -1.0, 1.0));
    if (distance <= reach && angle <= kMaxViewAngle)
      nearby.emplace_back(distance / kMaxViewDistance + angle / kMaxViewAngle, id);
  }
  std::sort(nearby.begin(), nearby.end());
  if (nearby.size() > kKeyframesNearby) nearby.resize(kKeyframesNearby);
  const auto right = [&](const std::optional<PoseProposal>& found) {
    return found && found->verified && expected.agrees(found->fit.cam_from_world);
  };
  if (nearby.empty()) return std::nullopt;
  for (const double radius : widening_radii(expected.covariance)) {
    auto found = relocaliser_.propose_at(map_.view(), nearby.front().second, expected.cam_from_world, radius, features,
                                         retracted_);
    if (right(found)) return found;
  }
  for (const auto& [off, id] : nearby) {
    auto found = relocaliser_.propose_from(map_.view(), id, features, retracted_);
    if (right(found)) return found;
  }
  return std::nullopt;
}

// A camera that was lost a moment ago still looks at what it saw last, if it may not have gone farther since than
// cameras that show the same are apart. Few matches are worth a try there.
std::optional<PoseProposal> Tracker::find_where_lost(const TrackedFrame& frame) const {
  if (state_ != TrackingState::lost || !last_) return std::nullopt;
  const double seconds = frame.timestamp - last_->timestamp;
  const PosePrediction near{last_->cam_from_world,
                            last_->covariance + seconds * seconds * VelocityFilter{}.covariance(0, seconds)};
  if (3 * std::sqrt(near.covariance.diagonal().head<3>().maxCoeff()) > kMaxViewDistance) return std::nullopt;
  const auto right = [&](const PlaceFit& fit) {
    return fit.inliers >= options_.min_inliers && near.agrees(fit.cam_from_world);
  };
  auto shown =
      fit_by_descriptors(points_shown_last(), frame.matchable(), optics_, options_.min_inliers, {.seed = seed_});
  if (shown && right(*shown)) {
    PoseProposal found;
    found.fit = std::move(*shown);
    return found;
  }
  if (map_.view().live_keyframe(last_->reference) == nullptr) return std::nullopt;
  auto found = relocaliser_.propose_from(map_.view(), last_->reference, frame.matchable(), retracted_);
  if (found && right(found->fit)) return found;
  return std::nullopt;
}

void Tracker::suggest(const PosePrediction& pose) {
  reset_motion();
  unconfirmed_.reset();
  lost_.reset();
  suggested_ = pose;
}

}  // namespace dkb
