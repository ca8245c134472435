// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/map/map.h"
#include "dkb/solver/bundle_adjustment.h"

namespace dkb {

// Says of each flat surface that a new keyframe sees which of those of its neighbours it is.
class PlaneRecogniser {
 public:
  PlaneRecogniser(const CameraModel& camera, const SensorNoise& noise);

  // Names the surfaces of a keyframe with a PlaneView: a surface is the one that half of the blocks which show it, at
  // least, show in the previous keyframe or in one of those that share most points. The same surface: see SensorNoise.
  void recognise(Map& map, KeyframeId id) const;

 private:
  // Which surface of `there` each of `here` is; -1 where none.
  std::vector<int> compare(const PlaneView& here, const PlaneView& there, const Rigid3& there_from_here) const;

  CameraModel camera_;
  SensorNoise noise_;
  Image<Eigen::Vector2f> rays_;  // at depth 1, through the blocks' middles
};

// Adds to a problem whose first cameras are `keyframes` the planes that several of them see: each as a pose, whose
// z = 0 is the plane, that edges join with the cameras. An edge says of the plane's tilt and offset what the keyframe
// sees of them, and next to nothing of where in the plane the camera is. Planes as landmarks of bundle adjustment:
// Kaess, ICRA 2015; Hsiao, Westman, Zhang and Kaess, ICRA 2017.
void add_planes(const Map& map, const std::vector<KeyframeId>& keyframes, BaProblem& problem);

}  // namespace dkb
