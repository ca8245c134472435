// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/timing.h"

#include <algorithm>

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

}  // namespace dkb
