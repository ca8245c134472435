// SPDX-License-Identifier: Apache-2.0
// Recorded by a hand-held Kinect (TUM fr1_xyz), where the sequence is at hand.
#include <gtest/gtest.h>

#include "dkb/util/test_data.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

TEST(RunRealData, FollowsEveryFrameOfAHandHeldKinect) {
  const std::string name = "rgbd_dataset_freiburg1_xyz";
  const fs::path dataset = outside_data(name);
  if (dataset.empty()) GTEST_SKIP() << no_outside_data(name);
  const TempFolder temp;
  const SlamRun run(dataset, temp / "out", {"--max-frames", "60"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), 60);
  EXPECT_LT(ape_of(dataset, run.out / "trajectory.txt"), 0.02);
}

}  // namespace
}  // namespace dkb::test
