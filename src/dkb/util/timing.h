// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
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

// Durations of named stages; one instance per thread, merged at the end. Memory is bounded: of each stage count, sum,
// extremes, and a histogram whose bins are 1% wide from 1 us to 1000 s. Counts, means and maxima are exact; medians and
// other quantiles are within 0.5%, from 1 us up.
class StageTimes {
 public:
  void add(const std::string& stage, double ms);
  void merge(const StageTimes& other);
  // Hands over what it holds.
  StageTimes take() { return std::exchange(*this, {}); }
  std::map<std::string, StageSummary> summaries() const;
  std::vector<StageTime> sums() const;
  // As Statistics::stage_histograms.
  std::map<std::string, std::vector<int>> histograms() const;

 private:
  struct Stage {
    size_t count = 0;
    double sum = 0;  // [ms]
    float min = 0, max = 0;
    int first_bin = 0;             // of `bins`, which hold the occupied ones and those between
    std::vector<uint32_t> bins{};  // how many durations
    void make_room(int first, int end);
    double at_rank(size_t rank) const;  // [ms] the duration that would stand there if all were sorted
  };
  std::map<std::string, Stage> stages_;
};

}  // namespace dkb
