// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/disturbances.h"

#include <algorithm>
#include <cmath>

#include "dkb/util/random.h"

namespace dkb::sim {

std::vector<int> frames_left(int count, double share, uint64_t seed) {
  std::vector<bool> missing(static_cast<size_t>(count), false);
  int left_to_drop = std::min(count - 1, static_cast<int>(std::lround(share * count)));
  Random random(seed);
  while (left_to_drop > 0) {
    const uint32_t start = 1 + random.below(static_cast<uint32_t>(count - 1));
    const uint32_t length = random.below(2) == 0 ? 1 : 2 + random.below(7);
    for (size_t i = start; i < start + length && i < missing.size() && left_to_drop > 0; ++i) {
      if (missing[i]) continue;
      missing[i] = true;
      --left_to_drop;
    }
  }
  std::vector<int> left;
  for (int i = 0; i < count; ++i)
    if (!missing[static_cast<size_t>(i)]) left.push_back(i);
  return left;
}

Flicker::Flicker(double duration, uint64_t seed) {
  Random random(seed);
  phase_ = random.uniform(0, 6.2832);
  double gain = 1;
  for (double t = random.uniform(0.4, 1.5); t < duration; t += random.uniform(0.4, 1.5)) {
    double next = gain;
    while (std::abs(std::log(next / gain)) < 0.2) next = std::exp(random.uniform(std::log(0.5), std::log(1.8)));
    gain = next;
    steps_.push_back({t, gain});
  }
}

double Flicker::gain(double t) const {
  const auto after =
      std::upper_bound(steps_.begin(), steps_.end(), t, [](double a, const Step& s) { return a < s.time; });
  return after == steps_.begin() ? 1 : std::prev(after)->gain;
}

double Flicker::lamps(double t, double exposure) const {
  constexpr double kRate = 100, kDepth = 0.3;  // [Hz]; lamps with a magnetic ballast dim by about a third
  const double half_turns = 3.141592653589793 * kRate * exposure;
  return 1 + kDepth * std::sin(half_turns) / half_turns * std::cos(2 * 3.141592653589793 * kRate * t + phase_);
}

}  // namespace dkb::sim
