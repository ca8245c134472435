// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dkb {

inline constexpr int64_t kNsPerSecond = 1'000'000'000;

// The double nearest to the stamp, which is what reading its decimals gives. Small stamps take one rounding, that of
// the division. For larger ones the fraction is exact to 6e-17 s, and from 2^20 s on no decimal of nine digits lies
// nearer than that to the middle between two doubles without being one.
inline double seconds_from_ns(int64_t ns) {
  constexpr int64_t kExact = int64_t{1} << 53;  // whole numbers up to here are doubles
  if (-kExact <= ns && ns <= kExact) return static_cast<double>(ns) / static_cast<double>(kNsPerSecond);
  const int64_t fraction = ((ns % kNsPerSecond) + kNsPerSecond) % kNsPerSecond;
  const int64_t whole = ns / kNsPerSecond - (ns % kNsPerSecond < 0 ? 1 : 0);
  return static_cast<double>(whole) + static_cast<double>(fraction) / static_cast<double>(kNsPerSecond);
}

// To the microsecond: what a double of today's dates can hold.
inline int64_t ns_from_seconds(double seconds) {
  return static_cast<int64_t>(std::llround(seconds * 1e6)) * 1000;
}

// A stamp written as decimal seconds ("1305031102.175304"), exactly; digits beyond the ninth are cut off. Nothing when
// it is no such number, or beyond what 64 bits of nanoseconds hold.
std::optional<int64_t> parse_stamp_ns(std::string_view text);

// The stamp as decimal seconds, with six digits or, where these do not suffice, nine.
std::string stamp_text(int64_t ns);

// Stamps of today in seconds carry a rounding error of 1e-7 s; limits that are met exactly must count as met.
inline constexpr double kStampRounding = 5e-7;  // [s]

// Timed observations about one image may differ from its stamp by the digits that were kept of it.
inline constexpr double kSameStamp = 0.002;  // [s]

// The element of `items`, which stand by rising stamps, whose stamp is nearest to `stamp` [s] and the same as it, the
// earlier one of two as near; null when there is none. `stamp_of` gives an element's stamp.
template <class Items, class StampOf>
auto find_same_stamp(const Items& items, double stamp, const StampOf& stamp_of) -> decltype(&*items.begin()) {
  const auto after = std::lower_bound(items.begin(), items.end(), stamp,
                                      [&](const auto& item, double at) { return stamp_of(item) < at; });
  decltype(&*items.begin()) nearest = nullptr;
  for (auto it = after == items.begin() ? after : after - 1; it != items.end() && it <= after; ++it) {
    const double distance = std::abs(stamp_of(*it) - stamp);
    if (distance <= kSameStamp && (nearest == nullptr || distance < std::abs(stamp_of(*nearest) - stamp)))
      nearest = &*it;
  }
  return nearest;
}

// [1/s] by the median of the intervals between rising stamps, rounded, 1 ... 1000; 30 where there is none.
double frame_rate_of(const std::vector<int64_t>& stamps_ns);

}  // namespace dkb
