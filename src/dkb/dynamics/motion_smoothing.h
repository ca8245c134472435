// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dkb/features/simd.h"
#include "dkb/geometry/camera.h"
#include "dkb/geometry/sensor_noise.h"
#include "dkb/image/image.h"

namespace dkb {

// Averages evidence over a surface, each cell with its weight: normalised convolution (Knutsson and Westin, CVPR 1993)
// by the recursive edge-aware filter of Gastal and Oliveira (SIGGRAPH 2011), whose edges here are depth jumps and
// concave folds. A fold is where inverse depth, which is linear in the image on every plane, bends away from the
// viewer.
class MotionSmoothing {
 public:
  MotionSmoothing(const CameraModel& camera, const SensorNoise& noise, int cell, Simd simd = best_simd());

  // `depth`: of the cells' middles [m], 0 = none. Sets what smooth() stops at.
  void set_surface(const Image<float>& depth);
  // Smooths both in place: sum of weight times evidence, and sum of weights.
  void smooth(Image<float>& weighted, Image<float>& weights) const;

 private:
  void find_creases(const Image<float>& depth);

  SensorNoise noise_;
  Simd simd_;
  double focal_;
  int cell_;                        // [px]
  float fade_ = 0;                  // [1 / m of depth] of a link per cell
  float crease_ = 0;                // [1/m] second difference of inverse depth in a fold between object and support
  Image<float> inverse_, damping_;  // 1 / depth; crease_link in folds, else 1
  Image<float> left_, up_;          // link to the neighbour, 0 ... 1
};

}  // namespace dkb
