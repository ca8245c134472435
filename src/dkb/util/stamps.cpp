// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/stamps.h"

#include <algorithm>

#include "dkb/util/settings.h"

namespace dkb {

std::optional<int64_t> parse_stamp_ns(std::string_view text) {
  constexpr int64_t kMaxSeconds = INT64_MAX / kNsPerSecond - 1;
  double value = 0;
  if (!parse_number(text, &value) || !(std::abs(value) < static_cast<double>(kMaxSeconds))) return std::nullopt;
  const bool negative = text.front() == '-';
  const size_t start = negative ? 1 : 0;
  const size_t point = std::min(text.find('.'), text.size());
  // Exponents and signs are numbers as well, but no decimals to be taken digit by digit.
  if (text.find_first_not_of("0123456789.", start) != std::string_view::npos) return ns_from_seconds(value);
  int64_t ns = 0;
  for (size_t i = start; i < point; ++i) ns = 10 * ns + (text[i] - '0');
  for (size_t digit = 0; digit < 9; ++digit) {
    const size_t i = point + 1 + digit;
    ns = 10 * ns + (i < text.size() ? text[i] - '0' : 0);
  }
  return negative ? -ns : ns;
}

std::string stamp_text(int64_t ns) {
  const uint64_t size = ns < 0 ? 0 - static_cast<uint64_t>(ns) : static_cast<uint64_t>(ns);
  std::string fraction = std::to_string(size % kNsPerSecond);
  fraction.insert(0, 9 - fraction.size(), '0');
  if (fraction.ends_with("000")) fraction.resize(6);
  return (ns < 0 ? "-" : "") + std::to_string(size / kNsPerSecond) + "." + fraction;
}

double frame_rate_of(const std::vector<int64_t>& stamps_ns) {
  std::vector<int64_t> intervals;
  for (size_t i = 1; i < stamps_ns.size(); ++i) intervals.push_back(stamps_ns[i] - stamps_ns[i - 1]);
  std::sort(intervals.begin(), intervals.end());
  if (intervals.empty() || intervals[intervals.size() / 2] <= 0) return 30;
  return std::clamp(std::round(1e9 / static_cast<double>(intervals[intervals.size() / 2])), 1.0, 1000.0);
}

}  // namespace dkb
