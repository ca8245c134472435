// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "dkb_slam/frame.h"

namespace dkb {

// The motion priors of frames that nobody looked at: they belong to the next frame that somebody does.
class SkippedMotion {
 public:
  void skip(const Frame& frame) { motion_ = joined_with(frame.prior()), any_ = true; }
  // The frame with the motion since the last one that was looked at; without a prior when a piece of it is missing.
  Frame with_motion(Frame frame) const {
    frame.set_prior(joined_with(frame.prior()));
    return frame;
  }

 private:
  std::optional<MotionPrior> joined_with(const std::optional<MotionPrior>& next) const {
    if (!any_) return next;
    if (!motion_ || !next) return std::nullopt;
    return joined(*motion_, *next);
  }

  bool any_ = false;
  std::optional<MotionPrior> motion_;  // of the frames left out
};

}  // namespace dkb
