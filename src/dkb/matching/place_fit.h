// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "dkb/matching/candidates.h"
#include "dkb/solver/absolute_pose.h"

namespace dkb {

// Matches by descriptor alone that make it worth a try whether a view shows a place.
constexpr int kMinPlaceMatches = 15;

// A point that so many keyframes see is to be expected wherever it should be in view.
inline bool well_known(const MapPoint& point) {
  return point.observations.size() >= 3;
}

// A part of the map: a keyframe, its best covisible ones, and their points.
struct MapArea {
  std::vector<KeyframeId> keyframes;  // the first is the one that the area is named after
  std::vector<Candidate> points;      // by increasing id
};
MapArea area_around(const Map& map, KeyframeId centre, size_t keyframes);

enum class Sighting : uint8_t { out_of_view, missed, found };

// A pose from which a camera sees points of the map, and which ones.
struct PlaceFit {
  Rigid3 cam_from_world;
  int inliers = 0;
  std::vector<PointId> points;  // per feature: the inlier that it shows, else kNoPoint
  // Of fit_by_projection():
  Matrix6d covariance = Matrix6d::Zero();  // right perturbation of world_from_cam, [m, rad]
  std::vector<Sighting> sightings;         // per known point
};

// The pose of a camera that sees `features`, without any idea of where it is: known points, each id once, are matched
// by descriptor alone, and RANSAC seeks the pose that most matches agree on. Matches of features that may lie on movers
// are left out. Nothing with fewer than `min_matches` matches or where RANSAC finds no pose. Deterministic for a seed.
std::optional<PlaceFit> fit_by_descriptors(const std::vector<Candidate>& known, const MatchableFeatures& matchable,
                                           const Optics& optics, int min_matches, const RansacOptions& ransac);

// [px] around where known points are expected by a pose that few of them told, and around where the pose refined on
// what was found there puts them. Chosen on the twins, where no view is a place seen before.
inline constexpr float kSearchRadii[] = {10, 4};

struct ProjectionFitOptions {
  ProjectionMatchOptions match;  // but for the radius
  int min_matches = 0;           // fewer are no place
  // A pose by guided matches rests on no fewer points than one without.
  PoseOptions pose{.min_inliers = RansacOptions().min_inliers};
};

// The pose near an expected one: known points are matched where they should be in view and the pose is refined on them,
// within the first radius [px], then from there within the next. Nothing when too few for a pose are found.
// Deterministic.
std::optional<PlaceFit> fit_by_projection(const std::vector<Candidate>& known, const MatchableFeatures& matchable,
                                          const Optics& optics, const Rigid3& expected_cam_from_world,
                                          std::span<const float> radii, const ProjectionFitOptions& options = {});

}  // namespace dkb
