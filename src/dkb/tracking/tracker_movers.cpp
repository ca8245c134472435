// SPDX-License-Identifier: Apache-2.0
// Somebody whom the map holds as still walks off.
#include <algorithm>

#include "dkb/geometry/decompositions.h"
#include "dkb/matching/pose_observation.h"
#include "dkb/solver/second_motion.h"
#include "dkb/tracking/tracker.h"
#include "dkb/util/chi_square.h"

namespace dkb {

// What searches of a frame matched, and which of it moves.
struct Tracker::TwoMotions {
  struct Match {
    size_t feature = 0;
    PointId point = kNoPoint;
    Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  };
  std::vector<Match> matches;
  SecondMotion motion;  // of these
  std::vector<std::optional<OdometryMatch>> odometry;

  void add(const TrackedFrame& frame) {
    for (size_t f = 0; f < frame.matched.size(); ++f)
      if (frame.matched[f] != kNoPoint) matches.push_back({f, frame.matched[f], frame.matched_in_world[f]});
  }
  // By feature; where they differ about a feature or a point, what the other search matched.
  void join(const TrackedFrame& other) {
    std::vector<PointId> points = other.matched;
    std::sort(points.begin(), points.end());
    std::erase_if(matches, [&](const Match& m) {
      return other.matched[m.feature] != kNoPoint || std::binary_search(points.begin(), points.end(), m.point);
    });
    add(other);
    std::sort(matches.begin(), matches.end(), [](const Match& a, const Match& b) { return a.feature < b.feature; });
  }
  std::vector<PoseObservation> observations(const RgbdFeatures& features, const Optics& optics) const {
    std::vector<PoseObservation> result;
    result.reserve(matches.size());
    for (const Match& m : matches)
      result.push_back(pose_observation(features.keypoints[m.feature], m.in_world, optics));
    return result;
  }
};

namespace {

std::optional<PosePrior> prior_of(const std::optional<PosePrediction>& prediction) {
  if (!prediction) return std::nullopt;
  return PosePrior{prediction->cam_from_world, inverse(prediction->covariance)};
}

}  // namespace

// The same frame, sought around an expected pose.
std::optional<TrackedFrame> Tracker::found_around(const PosePrediction& expected, const FrameFeatures& features,
                                                  const TrackedFrame& frame) {
  TrackedFrame found;
  found.index = frame.index;
  found.timestamp = frame.timestamp;
  found.features = features.at(velocity());
  found.motion = frame.motion;
  found.show_nothing();
  found.predicted = expected;
  found.predicted->weighs = true;
  if (!track_expected(expected, found)) return std::nullopt;
  return found;
}

// A pose that goes with him has chosen what the room's points match: most are not found, and the far ones where a turn
// makes up for him. So they are sought where the velocity puts the camera as well, and where two motions are found,
// once more where the camera's puts it, which has to confirm them.
std::optional<Tracker::TwoMotions> Tracker::two_motions(const TrackedFrame& frame, const FrameFeatures& features,
                                                        const std::optional<PosePrediction>& by_velocity) {
  const std::optional<PosePrior> expected = prior_of(by_velocity);
  const auto look_around = [&](const std::optional<PosePrediction>& camera) -> std::optional<TwoMotions> {
    const auto other = camera ? found_around(*camera, features, frame) : std::nullopt;
    TwoMotions both;
    both.add(frame);
    if (other) both.join(*other);
    both.odometry = other ? other->odometry : frame.odometry;
    auto motion =
        second_motion(optics_.camera, frame.cam_from_world, both.observations(*frame.features, optics_),
                      options_.min_inliers, expected ? &*expected : nullptr, other ? &other->cam_from_world : nullptr);
    if (!motion) return std::nullopt;
    both.motion = std::move(*motion);
    return both;
  };
  const auto first = look_around(by_velocity);
  if (!first) return std::nullopt;
  constexpr double kAnywhere = 1e6;  // [m^2, rad^2]
  return look_around(
      PosePrediction{.cam_from_world = first->motion.cam_from_world,
                     .covariance = by_velocity ? Matrix6d(by_velocity->covariance / first->motion.expected_weight)
                                               : Matrix6d(kAnywhere * Matrix6d::Identity())});
}

// One motion does not explain all matches: the pose is then by those of the camera's own. That is asked where what is
// near and what is far differ, and where the pose is not the one to be expected.
void Tracker::leave_out_mover(const FrameFeatures& features, TrackedFrame& frame) {
  const auto by_velocity = pose_by_velocity(frame.timestamp);
  if (!by_velocity || by_velocity->allows({frame.cam_from_world, inverse(frame.covariance)})) {
    TwoMotions one;
    one.add(frame);
    if (!near_and_far_differ(optics_.camera, frame.cam_from_world, one.observations(*frame.features, optics_))) return;
  }
  const auto both = two_motions(frame, features, by_velocity);
  if (!both) return;
  const std::vector<uint8_t>& moves = both->motion.moves;
  TrackedFrame by_still = frame;
  by_still.cam_from_world = both->motion.cam_from_world;
  by_still.inliers = static_cast<int>(std::count(moves.begin(), moves.end(), 0));
  by_still.matched.assign(frame.matched.size(), kNoPoint);
  by_still.show_nothing();
  for (size_t i = 0; i < both->matches.size(); ++i) {
    const TwoMotions::Match& m = both->matches[i];
    by_still.matched[m.feature] = m.point;
    by_still.matched_in_world[m.feature] = m.in_world;
    if (!moves[i]) by_still.points[m.feature] = m.point;
    by_still.outlier[m.feature] = moves[i];
  }
  // The surfaces that tell the step are his as well. The motion so far holds what the rest leaves open.
  by_still.predicted.reset();
  const Vector6d camera_velocity = velocity_by(by_still).velocity();
  if (by_velocity)
    by_still.predicted = {.cam_from_world = by_velocity->cam_from_world,
                          .covariance = by_velocity->covariance / both->motion.expected_weight,
                          .weighs = true};
  if (!refine_at_velocity(camera_velocity, features, by_still)) return;
  // Of the points that are followed from frame to frame some are his: those that fit are the room's.
  for (size_t f = 0; f < both->odometry.size(); ++f) {
    const auto& followed = both->odometry[f];
    if (!followed || by_still.matched[f] != kNoPoint) continue;
    const Pair pair = odometry_pair(static_cast<int>(f), *followed, by_still.cam_from_world);
    if (followed->moves || squared_error(pair, by_still.cam_from_world, *by_still.features) <= kChi2TwoDof95)
      by_still.odometry[f] = followed;
  }
  for (size_t i = 0; i < both->matches.size() && both->motion.sure; ++i) {
    const TwoMotions::Match& m = both->matches[i];
    const double depth = (frame.cam_from_world * m.in_world).z();
    by_still.second_motion.push_back(
        {frame.features->keypoints[m.feature].image_pixel, static_cast<float>(depth), moves[i] != 0});
  }
  frame = std::move(by_still);
}

}  // namespace dkb
