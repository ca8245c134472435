// SPDX-License-Identifier: Apache-2.0
#include "dkb/matching/place_fit.h"

#include "dkb/features/matching.h"
#include "dkb/matching/pose_observation.h"

namespace dkb {
MapArea area_around(const Map& map, KeyframeId centre, size_t keyframes) {
  MapArea area;
  area.keyframes.push_back(centre);
  for (const Covisible& c : map.keyframe(centre)->covisible)
    if (area.keyframes.size() < keyframes) area.keyframes.push_back(c.keyframe);
  area.points = candidates_of(map, map.points_of(area.keyframes));
  return area;
}

std::optional<PlaceFit> fit_by_descriptors(const std::vector<Candidate>& known, const MatchableFeatures& matchable,
                                           const Optics& optics, int min_matches, const RansacOptions& ransac) {
  const RgbdFeatures& features = matchable.features;
  std::vector<Descriptor> descriptors;
  descriptors.reserve(known.size());
  for (const Candidate& k : known) descriptors.push_back(k.descriptor);
  std::vector<DescriptorMatch> matches = match_brute_force(descriptors, features.descriptors);
  std::erase_if(matches, [&](const DescriptorMatch& m) { return matchable.on_mover(static_cast<size_t>(m.b)); });
  if (static_cast<int>(matches.size()) < min_matches) return std::nullopt;
  std::vector<PoseObservation> observations;
  observations.reserve(matches.size());
  for (const DescriptorMatch& m : matches)
    observations.push_back(pose_observation(features.keypoints[static_cast<size_t>(m.b)],
                                            known[static_cast<size_t>(m.a)].position, optics));
  const RansacPose pose = estimate_absolute_pose(optics.camera, observations, ransac);
  if (!pose.ok) return std::nullopt;
  PlaceFit fit;
  fit.cam_from_world = pose.pose;
  fit.inliers = pose.inliers;
  fit.points.assign(features.size(), kNoPoint);
  for (size_t i = 0; i < matches.size(); ++i)
    if (pose.inlier[i]) fit.points[static_cast<size_t>(matches[i].b)] = known[static_cast<size_t>(matches[i].a)].id;
  return fit;
}

std::optional<PlaceFit> fit_by_projection(const std::vector<Candidate>& known, const MatchableFeatures& matchable,
                                          const Optics& optics, const Rigid3& expected_cam_from_world,
                                          std::span<const float> radii, const ProjectionFitOptions& options) {
  const RgbdFeatures& features = matchable.features;
  PlaceFit fit;
  fit.cam_from_world = expected_cam_from_world;
  for (const float radius : radii) {
    ProjectionMatchOptions match = options.match;
    match.radius = radius;
    std::vector<uint8_t> visible(known.size(), 0);
    const auto matches = match_by_projection(known, matchable, optics, fit.cam_from_world, match, nullptr, &visible);
    if (static_cast<int>(matches.size()) < options.min_matches) return std::nullopt;
    std::vector<PoseObservation> observations;
    observations.reserve(matches.size());
    for (const ProjectionMatch& m : matches)
      observations.push_back(pose_observation(features.keypoints[static_cast<size_t>(m.feature)],
                                              known[static_cast<size_t>(m.candidate)].position, optics));
    const PoseEstimate pose = optimise_pose(optics.camera, fit.cam_from_world, observations, options.pose);
    if (!pose.ok) return std::nullopt;
    fit.cam_from_world = pose.cam_from_world;
    fit.covariance = pose.covariance;
    fit.inliers = pose.inliers;
    fit.points.assign(features.size(), kNoPoint);
    fit.sightings.resize(known.size());
    for (size_t i = 0; i < known.size(); ++i) fit.sightings[i] = visible[i] ? Sighting::missed : Sighting::out_of_view;
    for (size_t i = 0; i < matches.size(); ++i) {
      if (!pose.inlier[i]) continue;
      const auto shown = static_cast<size_t>(matches[i].candidate);
      fit.points[static_cast<size_t>(matches[i].feature)] = known[shown].id;
      fit.sightings[shown] = Sighting::found;
    }
  }
  return fit;
}

}  // namespace dkb
