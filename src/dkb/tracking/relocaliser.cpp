// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/relocaliser.h"

#include <algorithm>
#include <cmath>

#include "dkb/matching/pose_observation.h"
#include "dkb/tracking/descriptor_pose.h"

namespace dkb {
namespace {

constexpr size_t kWellKnownObservers = 3;  // keyframes that see a point which is to be expected in view

// Of what a lost camera is tried with. All figures: chosen on the twins, where no view is a place seen before.
constexpr size_t kCandidates = 6;               // look-alike keyframes that are tried
constexpr size_t kNeighbours = 4;               // covisible keyframes whose points are matched along with each one's
constexpr int kMinMatches = 15;                 // by descriptor alone that make a candidate worth a try
constexpr int kMinRansacInliers = 10;           // of these, that must agree on a pose
constexpr float kRadius = 10, kRadiusFine = 4;  // [px] first and second search nearby that pose

constexpr double kMaxPositionSd = 0.01;  // [m] standard deviation of the camera's place
constexpr double kAmbiguity = 0.5;       // poses elsewhere with this share of the most inliers rival the best ...
const double kClearLead = std::log(20);  // ... unless its log odds are so much less

bool same_place(const Rigid3& a, const Rigid3& b) {
  return (centre_in_world(a) - centre_in_world(b)).norm() < 0.1 &&
         vector_from_rotation((a * b.inverse()).rotation).norm() < 0.1;
}

}  // namespace

Relocaliser::Relocaliser(const CameraModel& camera, const SensorNoise& noise, double scale_factor, int levels,
                         uint64_t seed)
    : camera_(camera), noise_(noise), scale_factor_(scale_factor), levels_(levels), seed_(seed) {}

std::optional<PoseProposal> Relocaliser::find(const Map& map, const MatchableFeatures& features,
                                              const IgnoresPoint& ignores, PointAppearance* appearance,
                                              PlaceEvidence& evidence) const {
  std::vector<PoseProposal> proposals = propose(map, features, ignores, appearance);
  if (proposals.empty()) {  // after a view of nothing known the camera may be elsewhere
    evidence.clear();
    return std::nullopt;
  }
  std::vector<PointLook> looks;
  for (const PoseProposal& p : proposals) looks.insert(looks.end(), p.looks.begin(), p.looks.end());
  evidence.add(std::move(looks));
  for (PoseProposal& p : proposals) p.log_odds = evidence.log_odds(map, p.around);
  int most = 0;
  for (const PoseProposal& p : proposals) most = std::max(most, p.inliers);
  std::erase_if(proposals, [&](const PoseProposal& p) { return p.inliers < kAmbiguity * most; });
  // Of look-alike places the true one differs least from what is seen.
  const auto better = [](const PoseProposal& a, const PoseProposal& b) { return a.log_odds > b.log_odds; };
  std::stable_sort(proposals.begin(), proposals.end(), better);
  if (!proposals.front().verified) return std::nullopt;
  PoseProposal& best = proposals.front();
  for (const PoseProposal& other : proposals)
    if (!same_place(other.cam_from_world, best.cam_from_world) && other.log_odds > best.log_odds - kClearLead)
      best.ambiguous = true;
  return std::move(best);
}

std::vector<PoseProposal> Relocaliser::propose(const Map& map, const MatchableFeatures& features,
                                               const IgnoresPoint& ignores, PointAppearance* appearance) const {
  std::vector<Descriptor> still;
  for (size_t f = 0; f < features.features.size(); ++f)
    if (!features.on_mover(f)) still.push_back(features.features.descriptors[f]);
  std::vector<PoseProposal> proposals;
  for (const PlaceMatch& like : map.similar_keyframes(still, kCandidates)) {
    // A keyframe that sees what an earlier one led to would lead there again.
    const auto& points = map.keyframe(like.id)->points;
    const bool explained = std::any_of(proposals.begin(), proposals.end(), [&](const PoseProposal& p) {
      if (!p.verified) return false;
      const auto shared = std::count_if(p.points.begin(), p.points.end(), [&](PointId id) {
        return id != kNoPoint && std::find(points.begin(), points.end(), id) != points.end();
      });
      return shared >= kMinMatches;
    });
    if (explained) continue;
    if (auto proposal = propose_from(map, like.id, features, ignores)) {
      look_around(map, features, ignores, appearance, *proposal);
      proposals.push_back(std::move(*proposal));
    }
  }
  return proposals;
}

std::optional<PoseProposal> Relocaliser::propose_from(const Map& map, KeyframeId keyframe,
                                                      const MatchableFeatures& features,
                                                      const IgnoresPoint& ignores) const {
  PoseProposal proposal;
  proposal.keyframe = keyframe;
  const auto coarse = coarse_pose(map, keyframe, features, ignores, proposal.points);
  if (!coarse) return std::nullopt;
  proposal.cam_from_world = *coarse;
  const std::vector<Candidate> nearby = map_around(map, proposal.points, ignores);
  if (!search(nearby, kRadius, features, proposal)) return std::nullopt;
  if (!search(nearby, kRadiusFine, features, proposal)) return std::nullopt;
  return proposal;
}

std::optional<PoseProposal> Relocaliser::propose_at(const Map& map, KeyframeId keyframe,
                                                    const Rigid3& expected_cam_from_world, double radius,
                                                    const MatchableFeatures& features,
                                                    const IgnoresPoint& ignores) const {
  PoseProposal proposal;
  proposal.keyframe = keyframe;
  proposal.cam_from_world = expected_cam_from_world;
  const std::vector<Candidate> nearby = map_around(map, map.keyframe(keyframe)->points, ignores);
  for (const float r : {static_cast<float>(radius), kRadius, kRadiusFine})
    if (r <= radius && !search(nearby, r, features, proposal)) return std::nullopt;
  return proposal;
}

std::vector<Candidate> Relocaliser::map_around(const Map& map, const std::vector<PointId>& points,
                                               const IgnoresPoint& ignores) const {
  std::vector<Candidate> nearby = local_map_candidates(points, map);
  std::erase_if(nearby, [&](const Candidate& c) { return ignores(c.id); });
  return nearby;
}

// By descriptors alone.
std::optional<Rigid3> Relocaliser::coarse_pose(const Map& map, KeyframeId id, const MatchableFeatures& features,
                                               const IgnoresPoint& ignores, std::vector<PointId>& points) const {
  std::vector<DescribedPoint> known;
  const Keyframe& keyframe = *map.keyframe(id);
  for (size_t f = 0; f < keyframe.points.size(); ++f)
    if (const MapPoint* seen = map.point(keyframe.points[f]))
      known.push_back({seen->id, seen->position, keyframe.features->descriptors[f]});
  const size_t neighbours = std::min(keyframe.covisible.size(), kNeighbours);
  for (size_t n = 0; n < neighbours; ++n)
    for (PointId p : map.keyframe(keyframe.covisible[n].keyframe)->points)
      if (const MapPoint* seen = map.point(p)) known.push_back({seen->id, seen->position, seen->descriptor});
  // The keyframe's own descriptors come first and stay.
  const auto before = [](const DescribedPoint& a, const DescribedPoint& b) { return a.id < b.id; };
  const auto same = [](const DescribedPoint& a, const DescribedPoint& b) { return a.id == b.id; };
  std::stable_sort(known.begin(), known.end(), before);
  known.erase(std::unique(known.begin(), known.end(), same), known.end());
  std::erase_if(known, [&](const DescribedPoint& k) { return ignores(k.id); });

  RansacOptions ransac;
  ransac.seed = seed_ + static_cast<uint64_t>(id);
  ransac.min_inliers = kMinRansacInliers;
  auto found = pose_by_descriptors(known, features, camera_, noise_, scale_factor_, kMinMatches, ransac);
  if (!found) return std::nullopt;
  points = std::move(found->points);
  return found->cam_from_world;
}

// Matches the map nearby anew under the proposal's pose and refines it.
bool Relocaliser::search(const std::vector<Candidate>& nearby, float radius, const MatchableFeatures& features,
                         PoseProposal& proposal) const {
  ProjectionMatchOptions match;
  match.noise = noise_;
  match.radius = radius;
  const auto matches = match_by_projection(nearby, features, camera_, proposal.cam_from_world, scale_factor_, levels_,
                                           match, nullptr, nullptr);
  std::vector<PoseObservation> observations;
  for (const ProjectionMatch& m : matches)
    observations.push_back(pose_observation(features.features.keypoints[static_cast<size_t>(m.feature)],
                                            nearby[static_cast<size_t>(m.candidate)].position, noise_, scale_factor_));
  const PoseEstimate pose = optimise_pose(camera_, proposal.cam_from_world, observations);
  if (!pose.ok || pose.inliers < kMinRansacInliers) return false;
  proposal.cam_from_world = pose.cam_from_world;
  proposal.inliers = pose.inliers;
  proposal.position_sd = std::sqrt(pose.covariance.topLeftCorner<3, 3>().trace());
  proposal.verified = proposal.inliers >= kMinRelocalisationInliers && proposal.position_sd <= kMaxPositionSd;
  proposal.points.assign(features.features.size(), kNoPoint);
  for (size_t i = 0; i < matches.size(); ++i)
    if (pose.inlier[i])
      proposal.points[static_cast<size_t>(matches[i].feature)] = nearby[static_cast<size_t>(matches[i].candidate)].id;
  return true;
}

// How the map points look that should be in view. In a room that is only similar most are as they were, but some are
// others, and those are told by the points that no feature was matched with.
void Relocaliser::look_around(const Map& map, const MatchableFeatures& features, const IgnoresPoint& ignores,
                              PointAppearance* appearance, PoseProposal& proposal) const {
  const std::vector<Candidate> nearby = map_around(map, proposal.points, ignores);
  proposal.around.reserve(nearby.size());
  for (const Candidate& c : nearby) proposal.around.push_back(c.id);
  std::vector<PointId> matched;
  for (PointId p : proposal.points)
    if (p != kNoPoint) matched.push_back(p);
  std::sort(matched.begin(), matched.end());
  std::vector<uint8_t> visible(nearby.size(), 0);
  match_by_projection(nearby, features, camera_, proposal.cam_from_world, scale_factor_, levels_, {}, nullptr,
                      &visible);
  const Eigen::Vector3d centre = centre_in_world(proposal.cam_from_world);
  for (size_t i = 0; i < nearby.size(); ++i) {
    const Candidate& c = nearby[i];
    if (!visible[i] || map.point(c.id)->observations.size() < kWellKnownObservers) continue;
    if (std::binary_search(matched.begin(), matched.end(), c.id)) {
      proposal.looks.push_back({c.id, true});
      continue;
    }
    if (appearance == nullptr) continue;
    const Eigen::Vector3d in_cam = proposal.cam_from_world * c.position;
    const double scale = c.reference_scale * c.reference_distance / (c.position - centre).norm();
    const int octave =
        std::clamp(static_cast<int>(std::lround(std::log(scale) / std::log(scale_factor_))), 0, levels_ - 1);
    // What is gone may have been taken away: that happens in every place.
    const Look look = appearance->look(camera_.project(in_cam), in_cam.z(), octave, c.descriptor);
    if (look == Look::same || look == Look::other) proposal.looks.push_back({c.id, look == Look::same});
  }
}

}  // namespace dkb
