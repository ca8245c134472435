// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/prior_calibration.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "dkb/geometry/decompositions.h"
#include "dkb/geometry/rigid3.h"
#include "dkb/util/chi_square.h"
#include "dkb/util/quantile.h"

namespace dkb {
namespace {

constexpr size_t kRemembered = 300;  // steps: ten seconds at 30 Hz
constexpr double kUsual = 20;        // steps as they should be, which stand beside those at hand
constexpr double kExact = 1e-5;      // [m, rad] nothing tells a motion better
constexpr double kMaxFactor = 1e12;  // of a variance
constexpr int kHalvings = 20;        // of the interval in which a factor lies

}  // namespace

Frame PriorCalibration::calibrated(Frame frame) {
  given_ = frame.prior();
  if (!given_) return frame;
  rotation_only_ = given_->rotation_only;
  given_->covariance += kExact * kExact * Matrix6d::Identity();
  MotionPrior prior = *given_;
  prior.covariance *= std::max(1.0, factor_);
  frame.set_prior(say_nothing() ? std::nullopt : std::optional(prior));
  return frame;
}

std::string PriorCalibration::add(const MotionPrior& seen) {
  if (!given_) return "";
  Matrix6d claimed = given_->covariance;
  Vector6d off = tangent_from_rigid3(given_->previous_from_current.inverse() * seen.previous_from_current);
  Vector6d moved = tangent_from_rigid3(seen.previous_from_current);
  if (given_->rotation_only) {
    off.head<3>().setZero();
    moved.head<3>().setZero();
    claimed.topRows<3>().setZero();
    claimed.leftCols<3>().setZero();
  }
  const double middle = given_->rotation_only ? kChi2ThreeDofMedian : kChi2SixDofMedian;
  // In axes in which the images are off by one in each direction, and the prior by that of `by_prior`.
  const auto [seen_values, seen_axes] = spectrum(seen.covariance);
  const Matrix6d whiten = seen_values.cwiseSqrt().cwiseInverse().asDiagonal() * seen_axes.transpose();
  const auto [by_prior, axes] = spectrum(Matrix6d(whiten * claimed * whiten.transpose()));
  const Matrix6d to_axes = axes.transpose() * whiten;
  const auto squared_error = [&, &variances = by_prior](const Vector6d& of, double factor) {
    return ((to_axes * of).array().square() / (1 + factor * variances.array().max(0))).sum() / middle;
  };
  if (!std::isfinite(squared_error(off, 1))) return "";
  // The factor of the prior's covariance by which this step is off by as much as half of all steps are.
  double low = 0, high = 1;
  while (squared_error(off, high) > 1 && high < kMaxFactor) low = high, high *= 4;
  for (int i = 0; i < kHalvings; ++i) {
    const double factor = 0.5 * (low + high);
    (squared_error(off, factor) > 1 ? low : high) = factor;
  }
  steps_.push_back({high, squared_error(off, 1), squared_error(moved, 1)});
  if (steps_.size() > kRemembered) steps_.pop_front();
  factor_ = beside_usual(&Step::factor);
  if (!contradict_images() || std::exchange(told_, true)) return "";
  return "the motion priors contradict the images far beyond their covariance, and count for less or nothing: are "
         "they motions of the camera (x right, y down, z forward), and as exact as they say?";
}

bool PriorCalibration::contradict_images() const {
  // What half of all steps stay below, and all but one in a hundred, in as many directions as the prior tells of.
  const double half = rotation_only_ ? kChi2ThreeDofMedian : kChi2SixDofMedian;
  const double most = rotation_only_ ? kChi2ThreeDof99 : kChi2SixDof99;
  return static_cast<double>(steps_.size()) >= kUsual && beside_usual(&Step::squared_error) * half > most;
}

bool PriorCalibration::say_nothing() const {
  return contradict_images() && beside_usual(&Step::squared_error) >= beside_usual(&Step::squared_motion);
}

double PriorCalibration::beside_usual(double Step::*value) const {
  std::vector<double> of_steps;
  for (const Step& s : steps_) of_steps.push_back(s.*value);
  const auto n = static_cast<double>(of_steps.size());
  return (n * upper_median(of_steps) + kUsual) / (n + kUsual);
}

}  // namespace dkb
