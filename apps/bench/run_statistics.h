// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "dkb/evaluation/trajectory_error.h"

namespace dkb {

// Statistics over repeated runs. Each is a function of its arguments alone: resampling has a seed of its own.

struct Interval {
  double low = 0, high = 0;
};

constexpr size_t kLeastRuns = 5;  // fewer say too little for an interval

// What an interval is worth: `known` is false with too few values.
struct MedianInterval {
  double median = 0;
  Interval interval;
  bool known = false;
};
// 95% of the percentile bootstrap of the median (Efron, "Bootstrap Methods: Another Look at the Jackknife", Ann.
// Statist. 1979). With 5 values a 95% interval reaches from the smallest to the largest: the exact chance that the
// median of a resample is the smallest value is 5.8%.
MedianInterval median_interval(const std::vector<double>& values);

// Runs of two systems on one sequence; equal indices had the same seed.
struct PairedRuns {
  std::vector<double> ours, reference;  // the same number, positive
};
// Geometric mean over sequences of median(ours) / median(reference), and its interval by drawing seeds anew, the same
// for both systems, in every sequence. Unknown when a sequence has fewer than kLeastRuns runs, or there is none.
MedianInterval mean_ratio(const std::vector<PairedRuns>& sequences);

// Friedman's test by permutation (Friedman, "The Use of Ranks to Avoid the Assumption of Normality", JASA 1937):
// `blocks[b][t]` is the value of treatment t in block b, here weight t with seed b. Returns the chance that treatments
// without any effect differ in rank as much as these, (1 + permutations that do) / (1 + permutations); 1 for fewer than
// 2 blocks or 2 treatments. Throws InputError when the blocks differ in length.
double friedman_p_value(const std::vector<std::vector<double>>& blocks, uint64_t seed, int permutations = 10000);

}  // namespace dkb
