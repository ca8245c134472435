// SPDX-License-Identifier: Apache-2.0
#include "bench/run_statistics.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dkb/util/errors.h"
#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr int kResamples = 10000;
constexpr double kConfidence = 0.95;
constexpr uint64_t kSeed = 1;

// The values that leave (1 - kConfidence) / 2 of the sample on either side.
Interval percentile_interval(std::vector<double> samples) {
  std::sort(samples.begin(), samples.end());
  const double tail = 0.5 * (1.0 - kConfidence) * static_cast<double>(samples.size());
  const size_t low = std::min(static_cast<size_t>(tail), samples.size() - 1);
  return {samples[low], samples[samples.size() - 1 - low]};
}

// Ranks 1 ... n; equal values share the mean of theirs.
std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<size_t> order(values.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return values[a] < values[b]; });
  std::vector<double> ranks(values.size());
  for (size_t i = 0; i < order.size();) {
    size_t end = i + 1;
    while (end < order.size() && values[order[end]] == values[order[i]]) ++end;
    for (size_t k = i; k < end; ++k) ranks[order[k]] = 0.5 * static_cast<double>(i + 1 + end);
    i = end;
  }
  return ranks;
}

// Sum over treatments of (rank sum)^2: rises with Friedman's statistic, and is exact for ranks in halves.
double spread_of_rank_sums(const std::vector<std::vector<double>>& ranks) {
  double spread = 0;
  for (size_t t = 0; t < ranks[0].size(); ++t) {
    double sum = 0;
    for (const auto& block : ranks) sum += block[t];
    spread += sum * sum;
  }
  return spread;
}

}  // namespace

MedianInterval median_interval(const std::vector<double>& values) {
  MedianInterval result{median_of(values), {}, values.size() >= kLeastRuns};
  if (!result.known) return result;
  Random random(kSeed);
  std::vector<double> medians, drawn(values.size());
  for (int r = 0; r < kResamples; ++r) {
    for (double& value : drawn) value = values[random.below(static_cast<uint32_t>(values.size()))];
    medians.push_back(median_of(drawn));
  }
  result.interval = percentile_interval(std::move(medians));
  return result;
}

MedianInterval mean_ratio(const std::vector<PairedRuns>& sequences) {
  MedianInterval result;
  if (sequences.empty()) return result;
  result.known = true;
  double sum = 0;
  for (const PairedRuns& s : sequences) {
    if (s.ours.size() != s.reference.size() || s.ours.empty())
      throw InputError("mean_ratio: both systems need the same runs, at least one");
    result.known = result.known && s.ours.size() >= kLeastRuns;
    sum += std::log(median_of(s.ours) / median_of(s.reference));
  }
  const auto n = static_cast<double>(sequences.size());
  result.median = std::exp(sum / n);
  if (!result.known) return result;
  Random random(kSeed);
  std::vector<double> ratios, ours, reference;
  for (int r = 0; r < kResamples; ++r) {
    double drawn = 0;
    for (const PairedRuns& s : sequences) {
      ours.clear(), reference.clear();
      for (size_t i = 0; i < s.ours.size(); ++i) {
        const uint32_t k = random.below(static_cast<uint32_t>(s.ours.size()));
        ours.push_back(s.ours[k]), reference.push_back(s.reference[k]);
      }
      drawn += std::log(median_of(ours) / median_of(reference));
    }
    ratios.push_back(std::exp(drawn / n));
  }
  result.interval = percentile_interval(std::move(ratios));
  return result;
}

double friedman_p_value(const std::vector<std::vector<double>>& blocks, uint64_t seed, int permutations) {
  if (blocks.size() < 2 || blocks[0].size() < 2) return 1;
  std::vector<std::vector<double>> ranks;
  for (const auto& block : blocks) {
    if (block.size() != blocks[0].size()) throw InputError("friedman_p_value: blocks differ in length");
    ranks.push_back(ranks_of(block));
  }
  const double observed = spread_of_rank_sums(ranks);
  Random random(seed);
  int as_much = 0;
  for (int p = 0; p < permutations; ++p) {
    for (auto& block : ranks)
      for (size_t i = block.size() - 1; i > 0; --i)
        std::swap(block[i], block[random.below(static_cast<uint32_t>(i + 1))]);
    as_much += spread_of_rank_sums(ranks) >= observed;
  }
  return (1.0 + as_much) / (1.0 + permutations);
}

}  // namespace dkb
