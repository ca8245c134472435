// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/timing.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace dkb {

void StageTimes::merge(const StageTimes& other) {
  for (const auto& [stage, samples] : other.samples_) {
    auto& mine = samples_[stage];
    mine.insert(mine.end(), samples.begin(), samples.end());
  }
}

std::map<std::string, StageSummary> StageTimes::summaries() const {
  std::map<std::string, StageSummary> result;
  for (const auto& [stage, samples] : samples_) {
    if (samples.empty()) continue;
    std::vector<float> sorted = samples;
    std::sort(sorted.begin(), sorted.end());
    double sum = 0;
    for (float s : sorted) sum += s;
    const size_t n = sorted.size();
    result[stage] = {sum / static_cast<double>(n), sorted[n / 2], sorted[std::min(n - 1, n * 95 / 100)], sorted.back(),
                     n};
  }
  return result;
}

std::vector<StageTime> StageTimes::sums() const {
  std::vector<StageTime> result;
  for (const auto& [stage, samples] : samples_)
    result.push_back({stage, std::accumulate(samples.begin(), samples.end(), 0.0F)});
  return result;
}

std::map<std::string, std::vector<int>> StageTimes::histograms() const {
  std::map<std::string, std::vector<int>> result;
  for (const auto& [stage, samples] : samples_) {
    std::vector<int>& counts = result[stage];
    for (const float ms : samples) {
      const auto bin = static_cast<size_t>(std::clamp(4 * (std::log2(std::max(ms, 1e-6F)) + 5), 0.0F, 63.0F));
      if (bin >= counts.size()) counts.resize(bin + 1);
      ++counts[bin];
    }
  }
  return result;
}

}  // namespace dkb
