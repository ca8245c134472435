// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

struct LoopOptions {
  bool enabled = true;
  int neighbourhood = 2;           // steps along covisibility that make a keyframe a neighbour, >= 1
  int min_keyframes_between = 10;  // [keyframes] younger ones are never candidates, >= 0
  int min_inliers = 50;            // map points that the refined pose rests on, >= 10
  int min_support = 2;             // keyframes around the newest one that must show the area just there as well, >= 0
  // [m] what can have drifted without any path, >= 0; its growth with the path is the detector's.
  double drift_translation_base = 0.2;
};

}  // namespace dkb
