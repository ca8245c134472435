// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_formats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

namespace dkb {
namespace {

// A quarter turn about z, then 1, 2, 3 m away.
Trajectory one_pose() {
  const double half = std::sqrt(0.5);
  return {{1305031102.175304, "1305031102.175304", {Eigen::Quaterniond(-half, 0, 0, -half), {1, 2, 3}}}};
}

TEST(TrajectoryFormats, KittiHasTheMatrixByRows) {
  std::istringstream row(trajectory_to_kitti(one_pose()));
  const double expected[12] = {0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3};
  for (const double value : expected) {
    double read = 0;
    ASSERT_TRUE(row >> read);
    EXPECT_NEAR(read, value, 1e-12);
  }
  EXPECT_EQ(trajectory_to_kitti({}), "");
}

TEST(TrajectoryFormats, EurocHasExactNanosecondsAndTheRealPartFirst) {
  const std::string text = trajectory_to_euroc(one_pose());
  EXPECT_EQ(
      text.substr(text.find('\n') + 1),
      "1305031102175304000,1.000000000,2.000000000,3.000000000,0.707106781,0.000000000,0.000000000,0.707106781\n");
}

}  // namespace
}  // namespace dkb
