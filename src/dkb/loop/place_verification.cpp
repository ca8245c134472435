// SPDX-License-Identifier: Apache-2.0
#include "dkb/loop/place_verification.h"

#include "dkb/features/matching.h"
#include "dkb/matching/pose_observation.h"
#include "dkb/solver/absolute_pose.h"
#include "dkb/solver/pose_optimiser.h"

namespace dkb {
namespace {

constexpr int kReliableObservers = 3;
constexpr int kMinPoseMatches = 10;
constexpr int kMatchDistance = 60;               // [bits] of a descriptor match
constexpr float kMatchRatio = 0.85f;             // best over second best distance without a guess
constexpr int kMinRansacInliers = 15;            // pairs of points that one rigid motion explains
constexpr float kSearchRadii[] = {12.0f, 4.0f};  // [px] under that motion, and under the refined pose

}  // namespace

MapArea area_around(const Map& map, KeyframeId centre, int keyframes) {
  MapArea area;
  area.keyframes.push_back(centre);
  for (const Covisible& c : map.keyframe(centre)->covisible)
    if (static_cast<int>(area.keyframes.size()) < keyframes) area.keyframes.push_back(c.keyframe);
  for (PointId id : map.points_of(area.keyframes)) {
    const MapPoint& p = *map.point(id);
    area.points.push_back(candidate_of(p));
    area.reliable.push_back(static_cast<int>(p.observations.size()) >= kReliableObservers);
  }
  return area;
}

std::optional<Rigid3> locate_in_area(const Map& map, KeyframeId keyframe, const MapArea& area, const Optics& optics,
                                     uint64_t seed) {
  const Keyframe& k = *map.keyframe(keyframe);
  std::vector<Descriptor> theirs, ours;
  std::vector<int> features;
  for (const Candidate& c : area.points) theirs.push_back(c.descriptor);
  for (size_t f = 0; f < k.features->size(); ++f) {
    if (!(k.features->keypoints[f].depth > 0) && k.points[f] == kNoPoint) continue;
    ours.push_back(k.features->descriptors[f]);
    features.push_back(static_cast<int>(f));
  }
  MatchOptions match;
  match.max_distance = kMatchDistance;
  match.ratio = kMatchRatio;
  const auto matches = match_brute_force(ours, theirs, match);
  if (static_cast<int>(matches.size()) < kMinRansacInliers) return std::nullopt;
  std::vector<Eigen::Vector3d> in_world, in_cam;
  std::vector<double> sigma;
  for (const DescriptorMatch& m : matches) {
    const auto f = static_cast<size_t>(features[static_cast<size_t>(m.a)]);
    const Keypoint& p = k.features->keypoints[f];
    in_world.push_back(area.points[static_cast<size_t>(m.b)].position);
    in_cam.push_back(p.depth > 0 ? optics.camera.unproject(p.pixel.cast<double>(), p.depth)
                                 : k.cam_from_world * map.point(k.points[f])->position);
    sigma.push_back(optics.noise.depth_sigma(in_cam.back().z()));
  }
  RansacOptions ransac;
  ransac.chi2 = 7.815;
  ransac.min_inliers = kMinRansacInliers;
  ransac.seed = seed;
  const RansacPose found = estimate_rigid_motion(in_world, in_cam, sigma, ransac);
  if (!found.ok) return std::nullopt;
  return found.pose;
}

std::optional<PlaceFit> fit_to_area(const Map& map, KeyframeId keyframe, const Rigid3& cam_from_world,
                                    const MapArea& area, const Optics& optics) {
  const RgbdFeatures& features = *map.keyframe(keyframe)->features;
  PlaceFit fit;
  fit.cam_from_world = cam_from_world;
  for (const float radius : kSearchRadii) {
    ProjectionMatchOptions match;
    match.noise = optics.noise;
    match.radius = radius;
    match.max_distance = kMatchDistance;
    match.ratio = 0.9f;
    std::vector<uint8_t> visible(area.points.size(), 0);
    const auto matches = match_by_projection(area.points, features, optics.camera, fit.cam_from_world,
                                             optics.scale_factor, optics.levels, match, nullptr, &visible);
    if (static_cast<int>(matches.size()) < kMinPoseMatches) return std::nullopt;
    std::vector<PoseObservation> observations;
    for (const ProjectionMatch& m : matches)
      observations.push_back(pose_observation(features.keypoints[static_cast<size_t>(m.feature)],
                                              area.points[static_cast<size_t>(m.candidate)].position, optics.noise,
                                              optics.scale_factor));
    const PoseEstimate pose = optimise_pose(optics.camera, fit.cam_from_world, observations);
    if (!pose.ok || pose.inliers < kMinPoseMatches) return std::nullopt;
    fit.cam_from_world = pose.cam_from_world;
    fit.covariance = pose.covariance;
    fit.matches.clear();
    fit.expected = fit.found = 0;
    for (size_t i = 0; i < area.points.size(); ++i) fit.expected += visible[i] && area.reliable[i];
    for (size_t i = 0; i < matches.size(); ++i) {
      if (!pose.inlier[i]) continue;
      const auto c = static_cast<size_t>(matches[i].candidate);
      fit.matches.emplace_back(matches[i].feature, area.points[c].id);
      fit.found += area.reliable[c];
    }
  }
  return fit;
}

}  // namespace dkb
