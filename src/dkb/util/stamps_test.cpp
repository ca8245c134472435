// SPDX-License-Identifier: Apache-2.0
#include "dkb/util/stamps.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <limits>

#include "dkb/util/random.h"

namespace dkb {
namespace {

constexpr int64_t kToday = 1'305'031'102'175'304'000;  // 2011-05-10, a stamp of TUM's fr1_xyz

// The decimals of a stamp, all nine of them.
std::string nine_digits(int64_t ns) {
  const uint64_t size = ns < 0 ? 0 - static_cast<uint64_t>(ns) : static_cast<uint64_t>(ns);
  std::string fraction = std::to_string(size % 1'000'000'000);
  fraction.insert(0, 9 - fraction.size(), '0');
  return (ns < 0 ? "-" : "") + std::to_string(size / 1'000'000'000) + "." + fraction;
}

// Stamps of every size: today's, of a clock that starts at 0, around whole seconds, negative.
std::vector<int64_t> seeded_stamps(int count) {
  Random random(5);
  std::vector<int64_t> stamps = {0, 1, -1, 999'999'999, 1'000'000'000, -1'000'000'000, kToday, -kToday};
  for (int i = 0; i < count; ++i) {
    const auto any = static_cast<int64_t>(random.next() >> 2);  // below 4.6e18
    const int64_t ns = any >> random.below(62);
    stamps.push_back(random.below(4) == 0 ? -ns : ns);
    stamps.push_back(kToday + static_cast<int64_t>(random.next() >> 12));
    stamps.push_back(1000 * static_cast<int64_t>(random.next() >> 34));  // up to 12 days, in microseconds
  }
  return stamps;
}

TEST(Stamps, DecimalsAreReadExactly) {
  EXPECT_EQ(parse_stamp_ns("1305031102.175304"), kToday);
  EXPECT_EQ(parse_stamp_ns("1305031102.175304001"), kToday + 1);
  EXPECT_EQ(parse_stamp_ns("0"), 0);
  EXPECT_EQ(parse_stamp_ns("12"), 12'000'000'000);
  EXPECT_EQ(parse_stamp_ns("12."), 12'000'000'000);
  EXPECT_EQ(parse_stamp_ns("0.5"), 500'000'000);
  EXPECT_EQ(parse_stamp_ns("-0.000000001"), -1);
  EXPECT_EQ(parse_stamp_ns("-1.75"), -1'750'000'000);
  EXPECT_EQ(parse_stamp_ns("000000000000000000000000000012.5"), 12'500'000'000);
}

TEST(Stamps, DigitsBeyondTheNinthAreCutOff) {
  EXPECT_EQ(parse_stamp_ns("1.1234567899"), 1'123'456'789);
  EXPECT_EQ(parse_stamp_ns("-1.1234567899999999999999999999999999999999"), -1'123'456'789);
}

TEST(Stamps, ExponentsAreReadToTheMicrosecond) {
  EXPECT_EQ(parse_stamp_ns("1.5e3"), 1'500'000'000'000);
  EXPECT_EQ(parse_stamp_ns("1305031102175304e-6"), kToday);
  EXPECT_EQ(parse_stamp_ns("-25E-1"), -2'500'000'000);
}

TEST(Stamps, WhatIsNoNumberOrTooLargeIsRefused) {
  for (const char* text : {"", " ", "-", ".", "e5", "nan", "inf", "-inf", "1.5s", "1,5", "1.2.3", "0x10", "--1", "1 2",
                           "9223372036.9", "-9223372036.9", "1e10", "-1e300", "99999999999999999999999"})
    EXPECT_FALSE(parse_stamp_ns(text)) << text;
  EXPECT_EQ(parse_stamp_ns("9223372034.5"), 9'223'372'034'500'000'000);
  EXPECT_EQ(parse_stamp_ns("-9223372034.5"), -9'223'372'034'500'000'000);
}

TEST(Stamps, AreWrittenWithSixDigitsOrNine) {
  EXPECT_EQ(stamp_text(kToday), "1305031102.175304");
  EXPECT_EQ(stamp_text(kToday + 1), "1305031102.175304001");
  EXPECT_EQ(stamp_text(0), "0.000000");
  EXPECT_EQ(stamp_text(-1), "-0.000000001");
  EXPECT_EQ(stamp_text(-1'750'000'000), "-1.750000");
  EXPECT_EQ(stamp_text(INT64_MAX), "9223372036.854775807");
  EXPECT_EQ(stamp_text(INT64_MIN), "-9223372036.854775808");
}

TEST(Stamps, WhatIsWrittenIsReadBack) {
  for (const int64_t ns : seeded_stamps(3000)) {
    ASSERT_EQ(parse_stamp_ns(stamp_text(ns)), ns) << stamp_text(ns);
    ASSERT_EQ(parse_stamp_ns(nine_digits(ns)), ns) << nine_digits(ns);
  }
}

TEST(Stamps, SecondsAreThoseOfTheirDecimals) {
  for (const int64_t ns : seeded_stamps(5000))
    ASSERT_EQ(seconds_from_ns(ns), std::strtod(nine_digits(ns).c_str(), nullptr)) << nine_digits(ns);
}

TEST(Stamps, SecondsLeadBackToTheMicrosecond) {
  EXPECT_EQ(ns_from_seconds(1305031102.175304), kToday);
  EXPECT_EQ(ns_from_seconds(-0.0000014), -1000);
  for (const int64_t ns : seeded_stamps(3000)) {
    const int64_t whole = ns / 1000 * 1000;
    if (std::abs(whole) > 2 * kToday) continue;
    ASSERT_EQ(ns_from_seconds(seconds_from_ns(whole)), whole);
  }
}

TEST(Stamps, TheFarthestStampsAreSecondsToo) {
  EXPECT_EQ(seconds_from_ns(std::numeric_limits<int64_t>::min()), -9223372036.854775808);
  EXPECT_EQ(seconds_from_ns(std::numeric_limits<int64_t>::max()), 9223372036.854775807);
  EXPECT_EQ(seconds_from_ns(-9007199254740993), -9007199.254740993) << "a second less than its whole ones";
}

TEST(Stamps, OfTwoAsNearTheEarlierIsTheSame) {
  const auto itself = [](double stamp) { return stamp; };
  const std::vector<double> stamps = {1.0, 1.0 + 0x1p-9, 2.0};
  const double middle = 1.0 + 0x1p-10;
  EXPECT_EQ(find_same_stamp(stamps, middle, itself), &stamps[0]);
  EXPECT_EQ(find_same_stamp(stamps, 1.0 + 0x1.8p-10, itself), &stamps[1]);
  EXPECT_EQ(find_same_stamp(stamps, 1.5, itself), nullptr);
}

TEST(Stamps, AnyMutationIsReadOrRefused) {
  Random random(7);
  for (int i = 0; i < 50000; ++i) {
    std::string text = "1305031102.175304";
    for (uint32_t k = 1 + random.below(4); k > 0; --k) {
      const size_t at = random.below(static_cast<uint32_t>(text.size()));
      const char c = random.below(2) == 0 ? "0123456789.-+eE "[random.below(16)] : static_cast<char>(random.below(256));
      if (random.below(3) == 0)
        text.insert(at, 1, c);
      else
        text[at] = c;
    }
    const auto ns = parse_stamp_ns(text);
    if (ns && text.find_first_of("eE") == std::string::npos) {
      ASSERT_NEAR(1e-9 * static_cast<double>(*ns), std::strtod(text.c_str(), nullptr), 1e-6) << text;
    }
  }
}

}  // namespace
}  // namespace dkb
