// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/map/map.h"
#include "dkb/matching/candidates.h"

namespace dkb {

// What an image's features are measured with.
struct Optics {
  CameraModel camera;
  SensorNoise noise;
  double scale_factor = 1.2;
  int levels = 8;
};

// A part of the map that may be seen again: a keyframe, its best covisible ones, and their points.
struct MapArea {
  std::vector<KeyframeId> keyframes;  // the first is the one that the area is named after
  std::vector<Candidate> points;      // by increasing id
  std::vector<uint8_t> reliable;      // per point: seen by three keyframes at least
};
MapArea area_around(const Map& map, KeyframeId centre, int keyframes);

// How a keyframe shows an area of the map.
struct PlaceFit {
  Rigid3 cam_from_world;                         // in the area's part of the world
  Matrix6d covariance;                           // right perturbation of world_from_cam, [m, rad]
  std::vector<std::pair<int, PointId>> matches;  // feature of the keyframe, point of the area: inliers
  int expected = 0, found = 0;                   // reliable points that ought to be in view, and those matched
  double share() const { return expected > 0 ? static_cast<double>(found) / expected : 0; }
};

// Descriptors matched without any guess, then one rigid motion between the keyframe's points and the area's by RANSAC
// (3-D to 3-D). The keyframe's pose in the area's world, or nothing. Deterministic for a seed.
std::optional<Rigid3> locate_in_area(const Map& map, KeyframeId keyframe, const MapArea& area, const Optics& optics,
                                     uint64_t seed);

// Guided matching by projection, and the pose refined on it; twice, the second time within less. Nothing when too few
// points for a pose are found. Deterministic.
std::optional<PlaceFit> fit_to_area(const Map& map, KeyframeId keyframe, const Rigid3& cam_from_world,
                                    const MapArea& area, const Optics& optics);

}  // namespace dkb
