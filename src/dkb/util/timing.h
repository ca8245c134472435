// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "dkb_slam/frame.h"

namespace dkb {

// Steady-clock stopwatch in milliseconds. For reports only: no decision of a dataset run reads a clock.
class Stopwatch {
 public:
  Stopwatch() : start_(std::chrono::steady_clock::now()) {}
  double ms() const {
    return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_;
};

// Durations of named stages; one instance per thread, merged at the end.
class StageTimes {
 public:
  void add(const std::string& stage, double ms) { samples_[stage].push_back(static_cast<float>(ms)); }
  void merge(const StageTimes& other);
  // Hands over what it holds.
  StageTimes take() { return std::exchange(*this, {}); }
  std::map<std::string, StageSummary> summaries() const;
  std::vector<StageTime> sums() const;
  // As Statistics::stage_histograms.
  std::map<std::string, std::vector<int>> histograms() const;

 private:
  std::map<std::string, std::vector<float>> samples_;
};

}  // namespace dkb
