// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dkb/util/errors.h"

namespace dkb {

struct PaperFilterOptions {
  double flow_threshold = 1.0;  // [px] d_th of DKB eq. 9, > 0
  double spread_limit = 8.0;    // s below which the narrow threshold holds                    (DKB eq. 13)
  double narrow = 2.8;          // delta there                                                 (DKB eq. 13)
  double wide = 9.0;            // delta elsewhere                                             (DKB eq. 13)
  bool compensate = true;       // flow against the camera's own motion; false: raw eq. 9, for ablation only
  void check() const {
    require_option(flow_threshold > 0, "flow_threshold", flow_threshold, "greater than 0 px");
    require_option(narrow > 0, "narrow", narrow, "greater than 0");
    require_option(wide > 0, "wide", wide, "greater than 0");
  }
};

// Statistics of the depths of one box (DKB eqs. 10, 11 and the text before 12).
struct DepthSpread {
  double mean = 0;      // [m] mu
  double sigma = 0;     // [m]
  double ratio = 0;     // s = sigma_h / sigma_l, about mu; infinity when sigma_l = 0
  double delta = 0;     // eq. 13
  bool usable = false;  // false: fewer than 5 depths or sigma = 0, the test says nothing
};
DepthSpread depth_spread(std::span<const double> depths, const PaperFilterOptions& options);

// 1 = dynamic for each depth, by ((d - mu) / sigma)^2 > delta (DKB eqs. 12, 13).
std::vector<uint8_t> depth_test(std::span<const double> depths, const PaperFilterOptions& options);

}  // namespace dkb
