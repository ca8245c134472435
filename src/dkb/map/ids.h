// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace dkb {

using FrameIndex = int;      // counts the frames that a system was given, from 0
using KeyframeId = int32_t;  // counts keyframes in order of insertion, from 0; never used again
inline constexpr KeyframeId kNoKeyframe = -1;

using PlaneId = int32_t;  // counts planes in the order in which they were found, from 0
inline constexpr PlaneId kNoPlane = -1;

// A map point is named after its birth: the keyframe and the feature in it that first showed it. Tracking and mapping
// can therefore name the same new point alike without talking to each other.
using PointId = uint32_t;
inline constexpr int kPointFeatureBits = 13;
inline constexpr int kMaxFeaturesPerFrame = 1 << kPointFeatureBits;
inline constexpr PointId kNoPoint = 0xffffffffu;

// The last one that can name points other than kNoPoint.
inline constexpr KeyframeId kLastKeyframe = static_cast<KeyframeId>(kNoPoint >> kPointFeatureBits) - 1;

constexpr PointId make_point_id(KeyframeId birth, int feature) {
  return (static_cast<PointId>(birth) << kPointFeatureBits) | static_cast<PointId>(feature);
}
constexpr KeyframeId birth_keyframe(PointId id) {
  return static_cast<KeyframeId>(id >> kPointFeatureBits);
}
constexpr int birth_feature(PointId id) {
  return static_cast<int>(id & (kMaxFeaturesPerFrame - 1));
}

}  // namespace dkb
