// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/timing.h"

#include <algorithm>
#include <cmath>

namespace dkb {
namespace {

// Bin k holds durations from 2^(k/72 - 10) ms. 18 of these are one of Statistics::stage_histograms.
constexpr int kBinsPerOctave = 72, kLowestOctave = -10, kOctaves = 30;
constexpr int kFineInCoarse = 18, kLowestCoarseOctave = -5, kMostCoarse = 64;

int bin_of(float ms) {
  const double octaves = std::log2(static_cast<double>(std::max(ms, 1e-6F))) - kLowestOctave;
  return std::clamp(static_cast<int>(std::floor(kBinsPerOctave * std::min<double>(octaves, kOctaves))), 0,
                    kBinsPerOctave * kOctaves - 1);
}

}  // namespace

void StageTimes::Stage::make_room(int first, int end) {
  if (bins.empty()) first_bin = first;
  if (first < first_bin) {
    bins.insert(bins.begin(), static_cast<size_t>(first_bin - first), 0);
    first_bin = first;
  }
  bins.resize(std::max(bins.size(), static_cast<size_t>(end - first_bin)));
}

double StageTimes::Stage::at_rank(size_t rank) const {
  size_t below = 0, k = 0;
  while (k + 1 < bins.size() && (below += bins[k]) <= rank) ++k;
  const double middle = std::exp2((first_bin + static_cast<double>(k) + 0.5) / kBinsPerOctave + kLowestOctave);
  return std::clamp<double>(middle, min, max);
}

void StageTimes::add(const std::string& stage, double ms) {
  Stage& s = stages_[stage];
  const auto duration = static_cast<float>(ms);
  const int bin = bin_of(duration);
  s.make_room(bin, bin + 1);
  ++s.bins[static_cast<size_t>(bin - s.first_bin)];
  s.min = s.count == 0 ? duration : std::min(s.min, duration);
  s.max = s.count == 0 ? duration : std::max(s.max, duration);
  s.sum += duration;
  ++s.count;
}

void StageTimes::merge(const StageTimes& other) {
  for (const auto& [name, theirs] : other.stages_) {
    Stage& s = stages_[name];
    if (s.count == 0) {
      s = theirs;
      continue;
    }
    s.make_room(theirs.first_bin, theirs.first_bin + static_cast<int>(theirs.bins.size()));
    const auto from = static_cast<size_t>(theirs.first_bin - s.first_bin);
    for (size_t k = 0; k < theirs.bins.size(); ++k) s.bins[from + k] += theirs.bins[k];
    s.min = std::min(s.min, theirs.min);
    s.max = std::max(s.max, theirs.max);
    s.sum += theirs.sum;
    s.count += theirs.count;
  }
}

std::map<std::string, StageSummary> StageTimes::summaries() const {
  std::map<std::string, StageSummary> result;
  for (const auto& [name, s] : stages_)
    result[name] = {s.sum / static_cast<double>(s.count), s.at_rank(s.count / 2),
                    s.at_rank(std::min(s.count - 1, s.count * 95 / 100)), s.max, s.count};
  return result;
}

std::vector<StageTime> StageTimes::sums() const {
  std::vector<StageTime> result;
  for (const auto& [name, s] : stages_) result.push_back({name, static_cast<float>(s.sum)});
  return result;
}

std::map<std::string, std::vector<int>> StageTimes::histograms() const {
  constexpr int kSkipped = kBinsPerOctave * (kLowestCoarseOctave - kLowestOctave) / kFineInCoarse;
  std::map<std::string, std::vector<int>> result;
  for (const auto& [name, s] : stages_) {
    std::vector<int>& counts = result[name];
    for (size_t k = 0; k < s.bins.size(); ++k) {
      if (s.bins[k] == 0) continue;
      const int fine = s.first_bin + static_cast<int>(k);
      const auto bin = static_cast<size_t>(std::clamp(fine / kFineInCoarse - kSkipped, 0, kMostCoarse - 1));
      if (bin >= counts.size()) counts.resize(bin + 1);
      counts[bin] += static_cast<int>(s.bins[k]);
    }
  }
  return result;
}

}  // namespace dkb
