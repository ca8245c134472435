// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace dkb {

// The element that would stand at `share` (0 ... 1) of the values if they were sorted: one of them, never a mean of
// two. Puts `values`, of which there must be some, into another order.
template <class T>
T quantile(std::vector<T>& values, double share) {
  const size_t k = std::min(values.size() - 1, static_cast<size_t>(share * static_cast<double>(values.size())));
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(k), values.end());
  return values[k];
}

// Likewise the median; of an even number of values the upper of the middle two.
template <class T>
T upper_median(std::vector<T>& values) {
  return quantile(values, 0.5);
}

}  // namespace dkb
