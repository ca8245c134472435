// SPDX-License-Identifier: Apache-2.0
// Recorded by a hand-held Kinect (TUM fr1_xyz), where the sequence is at hand.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

TEST(RunRealData, FollowsEveryFrameOfAHandHeldKinect) {
  const fs::path dataset = fs::path(DKB_SOURCE_DIR) / "../shared/data/rgbd_dataset_freiburg1_xyz";
  if (!fs::exists(dataset / "associations.txt")) GTEST_SKIP() << "skipped: no recorded sequence at " << dataset;
  const TempFolder temp;
  const Finished run = run_program({"run", dataset.string(), "--out", (temp / "out").string(), "--detector", "none",
                                    "--max-frames", "60", "--quiet"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto stats = nlohmann::json::parse(read_text(temp.path() / "out" / "stats.json"));
  EXPECT_EQ(stats.at("tracked"), 60);
  EXPECT_LT(ape_of(dataset, temp.path() / "out" / "trajectory.txt"), 0.02);
}

}  // namespace
}  // namespace dkb::test
