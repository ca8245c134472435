// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "dkb/geometry/rigid3.h"

namespace dkb {

// Whether what somebody gives is a rigid motion: of finite numbers, the length of its quaternion as far off 1 as told.
inline bool is_rigid(const Rigid3& given, double tolerance) {
  return given.translation.allFinite() && std::abs(given.rotation.norm() - 1) <= tolerance;  // false for NaN
}
constexpr double kGivenNorm = 1e-3;  // of motions and poses while frames come

// Half of a matrix that is none is left out by whoever takes its inverse.
inline bool is_symmetric(const Matrix6d& given) {
  return (given - given.transpose()).cwiseAbs().maxCoeff() <= 1e-6 * given.cwiseAbs().maxCoeff();
}

}  // namespace dkb
