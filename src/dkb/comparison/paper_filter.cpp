// SPDX-License-Identifier: Apache-2.0
#include "dkb/comparison/paper_filter.h"

#include <cmath>
#include <limits>

namespace dkb {
namespace {

// DKB eq. 13.
constexpr double kSpreadLimit = 8.0;          // s below which the narrow threshold holds
constexpr double kNarrow = 2.8, kWide = 9.0;  // delta there, and elsewhere

}  // namespace

DepthSpread depth_spread(std::span<const double> depths) {
  DepthSpread s;
  if (depths.size() < 5) return s;
  for (double d : depths) s.mean += d;
  s.mean /= static_cast<double>(depths.size());
  double all = 0, high = 0, low = 0;
  size_t highs = 0, lows = 0;
  for (double d : depths) {
    const double square = (d - s.mean) * (d - s.mean);
    all += square;
    if (d > s.mean) {
      high += square;
      ++highs;
    } else if (d < s.mean) {
      low += square;
      ++lows;
    }
  }
  s.sigma = std::sqrt(all / static_cast<double>(depths.size()));
  if (!(s.sigma > 1e-12)) return s;
  const double sigma_h = highs > 0 ? std::sqrt(high / static_cast<double>(highs)) : 0;
  const double sigma_l = lows > 0 ? std::sqrt(low / static_cast<double>(lows)) : 0;
  s.ratio = sigma_l > 0 ? sigma_h / sigma_l : std::numeric_limits<double>::infinity();
  s.delta = s.ratio < kSpreadLimit ? kNarrow : kWide;
  s.usable = true;
  return s;
}

std::vector<uint8_t> depth_test(std::span<const double> depths) {
  std::vector<uint8_t> dynamic(depths.size(), 0);
  const DepthSpread s = depth_spread(depths);
  if (!s.usable) return dynamic;
  for (size_t i = 0; i < depths.size(); ++i) {
    const double th = (depths[i] - s.mean) / s.sigma;
    dynamic[i] = th * th > s.delta;
  }
  return dynamic;
}

}  // namespace dkb
