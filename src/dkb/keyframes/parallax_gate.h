// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>

#include "dkb/geometry/rigid3.h"

namespace dkb {

// What a translation of 1 is in the gate. The paper gives no unit; in metres only rotations would count.
enum class TranslationUnit {
  centimetre,
  depth_percent,  // 1/100 of the median depth of the tracked points: the same change of view counts alike near and far
};

// Motion of a frame since a keyframe.
struct Parallax {
  double rotation_deg = 0;  // [deg] 0 ... 180
  double translation = 0;   // [unit] between the camera centres
  double sum() const { return rotation_deg + translation; }
};

// Units in a metre, for points at a median depth [m]; where that is unknown (not > 0) depth_percent is centimetres.
double units_per_metre(TranslationUnit unit, double median_depth);

// DKB eqs. 14-16. Both poses in the same world; the translation is in the unit that a metre has so many of.
Parallax parallax_between(const Rigid3& last_cam_from_world, const Rigid3& cam_from_world, double units_in_metre);

// DKB eqs. 19-24, clamped to 0 ... 1. A still camera, for which eq. 24 is 0/0, gives 0.
double parallax_factor(const Parallax& mean);

// DKB eq. 25: the larger the less a camera moves.
double parallax_threshold(double factor);

// The gate before the votes: a frame that moved little since the last keyframe is none (DKB section 3.2, eqs. 14-25).
// Deterministic: depends on the parallaxes alone.
class ParallaxGate {
 public:
  // Takes the parallax of the next frame, against whichever keyframe was the last at that frame. True when it reaches
  // the threshold. Means are over the frames that are there (DKB eqs. 17, 18), this one included.
  bool passes(const Parallax& parallax);

  Parallax mean() const;                           // of the window; 0 before the first frame
  double factor() const { return factor_; }        // F of the last frame
  double threshold() const { return threshold_; }  // T of the last frame

 private:
  std::deque<Parallax> window_;
  double factor_ = 0, threshold_ = parallax_threshold(0);
};

}  // namespace dkb
