// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "dkb/features/frame_features.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/map/map.h"
#include "dkb/matching/optics.h"

namespace dkb {

// A map point as matching sees it.
struct Candidate {
  PointId id = kNoPoint;
  Eigen::Vector3d position;      // [m] in the world
  Eigen::Vector3f normal;        // mean unit direction to the cameras that saw it; zero = unknown
  float reference_distance = 0;  // [m] from the camera that gave the descriptor
  float reference_scale = 1;     // pyramid scale there
  float angle = -1;              // [rad] orientation of the feature to match with, -1 = unknown
  Descriptor descriptor;
  bool established = false;  // known still for long enough that it may be found even where a mover is suspected
};

Candidate candidate_of(const MapPoint& point);
std::vector<Candidate> candidates_of(const Map& map, const std::vector<PointId>& live_points);

// What feature `feature` shows, to be found again in another frame: it stands at `position` [m] in the world,
// `distance` [m] from the camera that saw it.
Candidate candidate_of(const RgbdFeatures& features, size_t feature, const Eigen::Vector3d& position, double distance,
                       const Optics& optics);

struct ProjectionMatchOptions {
  float radius = 4.0f;    // [px] search radius at the finest level, > 0; grows with the predicted scale
  int max_distance = 64;  // [bits] largest Hamming distance of a match, 0 ... 256
  float ratio = 0.8f;     // best distance must be below this share of the second best on the same level, 0 ... 1
};

struct ProjectionMatch {
  int feature = -1;
  int candidate = -1;
  int distance = 256;
};

// Matches candidates to features near their projections. One match per feature and candidate: the smaller distance
// wins, ties go to the earlier candidate. Features in `taken` and candidates in `skipped` (non-zero) are left alone.
// `visible` (when given) is set to 1 for each candidate whose projection lies in view. Deterministic; result by
// increasing feature.
std::vector<ProjectionMatch> match_by_projection(const std::vector<Candidate>& candidates,
                                                 const MatchableFeatures& matchable, const Optics& optics,
                                                 const Rigid3& cam_from_world, const ProjectionMatchOptions& options,
                                                 const std::vector<uint8_t>* taken, std::vector<uint8_t>* visible,
                                                 const std::vector<uint8_t>* skipped = nullptr);

}  // namespace dkb
