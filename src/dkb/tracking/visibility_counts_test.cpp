// SPDX-License-Identifier: Apache-2.0
#include "dkb/tracking/visibility_counts.h"

#include <gtest/gtest.h>

namespace dkb {
namespace {

TEST(VisibilityCounts, AddUpPerPointAndAreTakenOnceByIncreasingId) {
  VisibilityCounts counts;
  counts.add_visible({7, 3, 12});
  counts.add_found({12});
  counts.add_visible({1, 7, 7, 20});
  counts.add_found({7, 1});
  const auto taken = counts.take();
  ASSERT_EQ(taken.size(), 5u);
  const int expected[5][3] = {{1, 1, 1}, {3, 1, 0}, {7, 3, 1}, {12, 1, 1}, {20, 1, 0}};
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(taken[i].point, expected[i][0]);
    EXPECT_EQ(taken[i].visible, expected[i][1]);
    EXPECT_EQ(taken[i].found, expected[i][2]);
  }
  EXPECT_TRUE(counts.take().empty());
}

}  // namespace
}  // namespace dkb
