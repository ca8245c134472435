// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/relocaliser.h"

#include <algorithm>
#include <cmath>

#include "dkb/tracking/local_map.h"
#include "dkb/util/quantile.h"

namespace dkb {
namespace {

// Of what a lost camera is tried with. All figures: chosen on the twins, where no view is a place seen before.
constexpr size_t kCandidates = 6;  // look-alike keyframes that are tried
constexpr size_t kNeighbours = 4;  // covisible keyframes whose points are matched along with each one's

constexpr double kMaxPositionSd = 0.01;  // [m] standard deviation of the camera's place ...
constexpr double kMaxSdInView = 2;  // [px] ... or what shifts the view by so much, where it is far or the image small
constexpr double kAmbiguity = 0.5;  // poses elsewhere with this share of the most inliers rival the best ...
const double kClearLead = std::log(20);  // ... unless its log odds are so much less

bool same_place(const Rigid3& a, const Rigid3& b) {
  return (centre_in_world(a) - centre_in_world(b)).norm() < 0.1 &&
         vector_from_rotation((a * b.inverse()).rotation).norm() < 0.1;
}

void leave_out(std::span<const PointId> ignored, std::vector<Candidate>& points) {
  std::erase_if(points, [&](const Candidate& c) { return std::binary_search(ignored.begin(), ignored.end(), c.id); });
}

}  // namespace

Relocaliser::Relocaliser(const Optics& optics, uint64_t seed) : optics_(optics), seed_(seed) {}

std::optional<PoseProposal> Relocaliser::find(const Map& map, const MatchableFeatures& features,
                                              std::span<const PointId> ignored, PointAppearance* appearance,
                                              PlaceEvidence& evidence) const {
  std::vector<PoseProposal> proposals = propose(map, features, ignored, appearance);
  if (proposals.empty()) {  // after a view of nothing known the camera may be elsewhere
    evidence.clear();
    return std::nullopt;
  }
  std::vector<PointLook> looks;
  for (const PoseProposal& p : proposals) looks.insert(looks.end(), p.looks.begin(), p.looks.end());
  evidence.add(std::move(looks));
  for (PoseProposal& p : proposals) p.log_odds = evidence.log_odds(p.around);
  int most = 0;
  for (const PoseProposal& p : proposals) most = std::max(most, p.fit.inliers);
  std::erase_if(proposals, [&](const PoseProposal& p) { return p.fit.inliers < kAmbiguity * most; });
  // Of look-alike places the true one differs least from what is seen.
  const auto better = [](const PoseProposal& a, const PoseProposal& b) { return a.log_odds > b.log_odds; };
  std::stable_sort(proposals.begin(), proposals.end(), better);
  const auto verified = std::find_if(proposals.begin(), proposals.end(), [](const auto& p) { return p.verified; });
  if (verified == proposals.end()) return std::nullopt;
  PoseProposal& best = *verified;
  for (const PoseProposal& other : proposals)
    if (!same_place(other.fit.cam_from_world, best.fit.cam_from_world) && other.log_odds > best.log_odds - kClearLead)
      best.ambiguous = true;
  return std::move(best);
}

std::vector<PoseProposal> Relocaliser::propose(const Map& map, const MatchableFeatures& features,
                                               std::span<const PointId> ignored, PointAppearance* appearance) const {
  std::vector<Descriptor> still;
  for (size_t f = 0; f < features.features.size(); ++f)
    if (!features.on_mover(f)) still.push_back(features.features.descriptors[f]);
  std::vector<PoseProposal> proposals;
  for (const PlaceMatch& like : map.similar_keyframes(still, kCandidates)) {
    // A keyframe that sees what an earlier one led to would lead there again.
    std::vector<PointId> points = map.keyframe(like.id)->points;
    std::sort(points.begin(), points.end());
    const bool explained = std::any_of(proposals.begin(), proposals.end(), [&](const PoseProposal& p) {
      if (!p.verified) return false;
      const auto shared = std::count_if(p.fit.points.begin(), p.fit.points.end(), [&](PointId id) {
        return id != kNoPoint && std::binary_search(points.begin(), points.end(), id);
      });
      return shared >= kMinPlaceMatches;
    });
    if (explained) continue;
    if (auto proposal = propose_from(map, like.id, features, ignored)) {
      look_around(map, appearance, *proposal);
      proposals.push_back(std::move(*proposal));
    }
  }
  return proposals;
}

std::optional<PoseProposal> Relocaliser::propose_from(const Map& map, KeyframeId keyframe,
                                                      const MatchableFeatures& features,
                                                      std::span<const PointId> ignored) const {
  std::vector<Candidate> known = area_around(map, keyframe, 1 + kNeighbours).points;
  // What this keyframe shows is known by how it looks there.
  const Keyframe& seen_there = *map.keyframe(keyframe);
  for (size_t f = 0; f < seen_there.points.size(); ++f) {
    if (map.point(seen_there.points[f]) == nullptr) continue;
    std::lower_bound(known.begin(), known.end(), seen_there.points[f], [](const Candidate& c, PointId id) {
      return c.id < id;
    })->descriptor = seen_there.features->descriptors[f];
  }
  leave_out(ignored, known);
  const auto coarse =
      fit_by_descriptors(known, features, optics_, kMinPlaceMatches, {.seed = seed_ + static_cast<uint64_t>(keyframe)});
  if (!coarse) return std::nullopt;
  return fit_around(map, coarse->points, features, ignored, coarse->cam_from_world, kSearchRadii);
}

std::optional<PoseProposal> Relocaliser::propose_at(const Map& map, KeyframeId keyframe,
                                                    const Rigid3& expected_cam_from_world, double radius,
                                                    const MatchableFeatures& features,
                                                    std::span<const PointId> ignored) const {
  std::vector<float> radii = {static_cast<float>(radius)};
  for (const float r : kSearchRadii)
    if (r <= radius) radii.push_back(r);
  return fit_around(map, map.keyframe(keyframe)->points, features, ignored, expected_cam_from_world, radii);
}

// In the map around these points.
std::optional<PoseProposal> Relocaliser::fit_around(const Map& map, const std::vector<PointId>& points,
                                                    const MatchableFeatures& features, std::span<const PointId> ignored,
                                                    const Rigid3& expected_cam_from_world,
                                                    std::span<const float> radii) const {
  PoseProposal proposal;
  proposal.around = local_map_candidates(points, map);
  leave_out(ignored, proposal.around);
  auto fit = fit_by_projection(proposal.around, features, optics_, expected_cam_from_world, radii);
  if (!fit) return std::nullopt;
  proposal.fit = std::move(*fit);
  std::vector<double> depths;
  for (size_t i = 0; i < proposal.around.size(); ++i)
    if (proposal.fit.sightings[i] == Sighting::found)
      depths.push_back((proposal.fit.cam_from_world * proposal.around[i].position).z());
  if (proposal.fit.inliers < kMinRelocalisationInliers || depths.empty()) return proposal;
  const double limit = std::max(kMaxPositionSd, kMaxSdInView * upper_median(depths) / optics_.camera.fx);
  proposal.verified = std::sqrt(proposal.fit.covariance.topLeftCorner<3, 3>().trace()) <= limit;
  return proposal;
}

// How the map points look that should be in view. In a room that is only similar most are as they were, but some are
// others, and those are told by the points that no feature was matched with.
void Relocaliser::look_around(const Map& map, PointAppearance* appearance, PoseProposal& proposal) const {
  const Eigen::Vector3d centre = centre_in_world(proposal.fit.cam_from_world);
  for (size_t i = 0; i < proposal.around.size(); ++i) {
    const Candidate& c = proposal.around[i];
    const Sighting sighting = proposal.fit.sightings[i];
    if (sighting == Sighting::out_of_view || !well_known(*map.point(c.id))) continue;
    if (sighting == Sighting::found) {
      proposal.looks.push_back({c.id, true});
      continue;
    }
    if (appearance == nullptr) continue;
    const Eigen::Vector3d in_cam = proposal.fit.cam_from_world * c.position;
    const double scale = c.reference_scale * c.reference_distance / (c.position - centre).norm();
    const int octave = std::clamp(static_cast<int>(std::lround(std::log(scale) / std::log(optics_.scale_factor))), 0,
                                  optics_.levels - 1);
    const Look look = appearance->look(optics_.camera.project(in_cam), in_cam.z(), octave, c.descriptor);
    if (look != Look::unknown) proposal.looks.push_back({c.id, look == Look::same});
  }
}

}  // namespace dkb
