// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "dkb/geometry/decompositions.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/util/chi_square.h"
#include "dkb/util/quantile.h"
#include "dkb_slam/frame.h"

namespace dkb {

// How far motion priors are off, in units of what they claim: steps whose both ends the images tell show it. Wheels
// slip more than their driver says, and a prior in the axes of the base is no motion of the camera at all.
// Deterministic.
class PriorCalibration {
 public:
  // The same with a covariance that those before it have deserved; never a smaller one.
  Frame calibrated(Frame frame) const {
    if (!frame.prior() || scale() == 1) return frame;
    MotionPrior prior = *frame.prior();
    prior.covariance *= scale();
    frame.set_prior(prior);
    return frame;
  }
  // A prior as calibrated() left it, and the same step by the images. What to tell people, once, or nothing.
  std::string add(const MotionPrior& prior, const MotionPrior& seen) {
    Vector6d off = tangent_from_rigid3(prior.previous_from_current.inverse() * seen.previous_from_current);
    Matrix6d sum = prior.covariance / scale() + seen.covariance;
    if (prior.rotation_only) {
      off.head<3>().setZero();
      sum.topRows<3>().setIdentity();
      sum.bottomLeftCorner<3, 3>().setZero();
    }
    const double squared = off.dot(solve_symmetric(sum, off));
    if (!std::isfinite(squared)) return "";
    ratios_.push_back(squared / (prior.rotation_only ? kChi2ThreeDofMedian : kChi2SixDofMedian));
    if (ratios_.size() > kRemembered) ratios_.pop_front();
    std::vector<double> ratios(ratios_.begin(), ratios_.end());
    const auto n = static_cast<double>(ratios.size());
    variance_ = (n * upper_median(ratios) + kUsual) / (n + kUsual);
    if (!contradicts_images() || std::exchange(told_, true)) return "";
    return "the motion priors contradict the images far beyond their covariance, and count for less: are they motions "
           "of the camera (x right, y down, z forward), and as exact as they say?";
  }
  // Half of the steps are off by what not one in a hundred may be.
  bool contradicts_images() const {
    return static_cast<double>(ratios_.size()) >= kUsual && variance_ * kChi2SixDofMedian > kChi2SixDof99;
  }

 private:
  static constexpr size_t kRemembered = 300;  // steps: ten seconds at 30 Hz
  static constexpr double kUsual = 20;        // steps as they should be, which stand beside those at hand

  double scale() const { return std::max(1.0, variance_); }

  std::deque<double> ratios_;  // squared errors over their median
  double variance_ = 1;        // of errors, in units of that claimed
  bool told_ = false;
};

}  // namespace dkb
