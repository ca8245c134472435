// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace dkb::solver {

// Damping of the Levenberg-Marquardt method by Nielsen's rule (Madsen, Nielsen, Tingleff, "Methods for non-linear least
// squares problems").
class NielsenDamping {
 public:
  NielsenDamping(double initial, double min) : value_(initial), min_(min) {}
  double value() const { return value_; }
  // The step lowered the cost by `saved`, and the quadratic model had promised `predicted`; both > 0.
  void accept(double saved, double predicted) {
    const double z = 2 * saved / predicted - 1;
    value_ = std::max(min_, value_ * std::max(1.0 / 3.0, 1 - z * z * z));
    growth_ = 2;
  }
  // The step did not lower the cost. False when the damping has become so large that no step is left to try.
  bool reject() {
    value_ *= growth_;
    growth_ *= 2;
    return !(value_ > kMax);
  }

 private:
  static constexpr double kMax = 1e10;
  double value_, min_, growth_ = 2;
};

}  // namespace dkb::solver
