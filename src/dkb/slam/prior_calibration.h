// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "dkb_slam/frame.h"

namespace dkb {

// How far motion priors are off, in units of what they claim: steps whose both ends the images tell show it. Wheels
// slip more than their driver says, and a prior in the axes of the base is no motion of the camera at all.
// Deterministic.
class PriorCalibration {
 public:
  // The frame with its prior's covariance as those before it have deserved, never a smaller one; without the prior
  // where they say nothing of the motion.
  Frame calibrated(Frame frame);
  // The step of the last prior by the images. What to tell people, once, or nothing.
  std::string add(const MotionPrior& seen);
  // Half of the steps are off by what not one in a hundred may be.
  bool contradict_images() const;
  // That the camera stands still fits no worse.
  bool say_nothing() const;

 private:
  // Squares are over the covariance of prior and images, and over the median of such squares.
  struct Step {
    double factor;  // of the prior's covariance, by which it fits
    double squared_error;
    double squared_motion;
  };

  double beside_usual(double Step::*value) const;

  std::optional<MotionPrior> given_;  // of this frame
  bool rotation_only_ = false;        // the last one
  std::deque<Step> steps_;
  double factor_ = 1;  // of variances
  bool told_ = false;
};

}  // namespace dkb
