// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace dkb {

// What a squared error over its variance stays below, by its degrees of freedom, in 95, 99, 99.9 or 50% of all cases:
// quantiles of the chi-square distribution.
inline constexpr double kChi2OneDof95 = 3.841, kChi2TwoDof95 = 5.991, kChi2ThreeDof95 = 7.815;
inline constexpr double kChi2ThreeDof99 = 11.345, kChi2SixDof99 = 16.812, kChi2ThreeDof999 = 16.266;
inline constexpr double kChi2ThreeDofMedian = 2.366, kChi2SixDofMedian = 5.348;

}  // namespace dkb
