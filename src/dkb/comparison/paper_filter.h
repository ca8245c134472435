// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace dkb {

struct PaperFilterOptions {
  double flow_threshold = 1.0;  // [px] d_th of DKB eq. 9, > 0
  bool compensate = true;       // flow against the camera's own motion; false: raw eq. 9, for ablation only
};

// Statistics of the depths of one box (DKB eqs. 10, 11 and the text before 12).
struct DepthSpread {
  double mean = 0;      // [m] mu
  double sigma = 0;     // [m]
  double ratio = 0;     // s = sigma_h / sigma_l, about mu; infinity when sigma_l = 0
  double delta = 0;     // eq. 13
  bool usable = false;  // false: fewer than 5 depths or sigma = 0, the test says nothing
};
DepthSpread depth_spread(std::span<const double> depths);

// 1 = dynamic for each depth, by ((d - mu) / sigma)^2 > delta (DKB eqs. 12, 13).
std::vector<uint8_t> depth_test(std::span<const double> depths);

}  // namespace dkb
