// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <ctime>

#include <utility>
#include <vector>

#include "dkb_slam/slam.h"
#include "figures.h"

namespace dkb {

// [ms] that the calling thread has computed so far. Other programs on the machine count less here than by the clock.
inline double thread_cpu_ms() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

// What one frame took to track, by the clock and in time of the thread that called process().
struct FrameTime {
  double tracking_ms = 0, cpu_ms = 0;
};

inline FrameTime timed_frame(Slam& slam, const Frame& frame, FrameResult* result) {
  const double before = thread_cpu_ms();
  *result = slam.process(frame);
  return {result->tracking_ms, thread_cpu_ms() - before};
}

inline double p95(const std::vector<FrameTime>& times, double FrameTime::*which) {
  std::vector<double> values;
  values.reserve(times.size());
  for (const FrameTime& t : times) values.push_back(t.*which);
  return percentile(std::move(values), 0.95);
}

}  // namespace dkb
