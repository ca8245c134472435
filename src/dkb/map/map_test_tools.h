// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "dkb/map/map.h"
#include "dkb/util/random.h"

namespace dkb::test {

// A camera with the distortion of fr1.
CameraModel distorted_camera();

// Features at random places with random descriptors; most have depth. `follow`: the ideal pixels are those of the
// camera's table, else they lie a pixel or so away, as where the camera moved.
std::shared_ptr<const RgbdFeatures> random_features(Random& random, int count, const CameraModel& camera, bool follow);

// Adds a keyframe that sees some of the points of its predecessors and gives birth to `born` points.
KeyframeId add_random_keyframe(Map& map, Random& random, int features, int seen, int born);

// One random change of any kind that Map offers.
void random_edit(Map& map, Random& random);

// `keyframes` keyframes with random edits between them.
Map random_map(uint64_t seed, int keyframes, int features, int edits_per_keyframe);

// A keyframe with features that show no point; its centre lies at -x [m] and its parent is the keyframe before it.
Keyframe keyframe_at(KeyframeId id, double x, int features = 6);
// Adds the point that is born at this feature.
PointId born(Map& map, KeyframeId keyframe, int feature);

// Keyframes 0, 1, 2 in a chain; points a, b, c, d born at features 0 ... 3 of keyframe 0. Keyframe 1 sees a, b, c;
// keyframe 2 sees a.
struct ThreeKeyframes {
  Map map;
  PointId a, b, c, d;
  ThreeKeyframes();
};

// What holds of every map and does not hold of this one; empty when all is well.
std::string broken_invariant(const Map& map);

// Every field of every part, bit for bit, features included; of the points that are no more, where they resolve to.
std::string fingerprint(const Map& map);

}  // namespace dkb::test
