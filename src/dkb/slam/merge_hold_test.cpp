// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/merge_hold.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

// A wall of 20 x 20 points, 5 cm apart, that look the same.
std::vector<JudgedPoint> wall() {
  std::vector<JudgedPoint> points;
  for (int y = 0; y < 20; ++y)
    for (int x = 0; x < 20; ++x) points.push_back({{0.05 * x, 0.05 * y, 2}, 5});
  return points;
}

TEST(PlaceDifference, CornersThatFailOneByOneAreNone) {
  auto points = wall();
  for (size_t i = 21; i < points.size(); i += 44) points[i].votes = -5;
  const PlaceDifference difference = difference_of(points);
  EXPECT_EQ(difference.judged, 400);
  EXPECT_EQ(difference.different, 0);
}

TEST(PlaceDifference, AThingThatIsAnotherIsOne) {
  auto points = wall();
  for (size_t y = 5; y < 9; ++y)
    for (size_t x = 5; x < 9; ++x) points[20 * y + x].votes = -5;
  const PlaceDifference difference = difference_of(points);
  EXPECT_EQ(difference.judged, 400);
  EXPECT_GE(difference.different, 12);
  EXPECT_LE(difference.different, 16);
}

TEST(PlaceDifference, PointsWithNothingAroundThemSayNothing) {
  EXPECT_EQ(difference_of({{{0, 0, 2}, -5}, {{0.1, 0, 2}, -5}, {{0, 0.1, 2}, -5}, {{3, 0, 2}, -5}}).judged, 0);
}

}  // namespace
}  // namespace dkb
