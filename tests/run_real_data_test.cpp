// SPDX-License-Identifier: Apache-2.0
// Recorded by a hand-held Kinect (TUM fr1_xyz), where the sequence is at hand.
#include <gtest/gtest.h>

#include <fstream>
#include <sstream>

#include "dkb/geometry/camera.h"
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

// With a camera file that knows neither, as most do.
TEST(RunRealData, LearnsWhenAKinectSeesWhatItsImagesShow) {
  const std::string name = "rgbd_dataset_freiburg1_xyz";
  const fs::path dataset = outside_data(name);
  if (dataset.empty()) GTEST_SKIP() << no_outside_data(name);
  const TempFolder temp;
  Camera camera = *builtin_camera("fr1");
  camera.readout = camera.depth_time_offset = 0;
  write_text(temp / "camera.yaml", camera.to_yaml());
  const SlamRun run(dataset, temp / "out", {"--camera", temp / "camera.yaml"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_NEAR(run.stats.at("timing").at("depth_time_offset"), -0.018, 0.006);
  EXPECT_NEAR(run.stats.at("timing").at("readout"), 0.0235, 0.006);
  EXPECT_LT(ape_of(dataset, run.out / "trajectory.txt"), 0.0046);
}

// Between slow frames a hand changes its velocity by more than a search for points forgives.
TEST(RunRealData, EveryThirdFrameIsFollowedAsWell) {
  const std::string name = "rgbd_dataset_freiburg1_xyz";
  const fs::path dataset = outside_data(name);
  if (dataset.empty()) GTEST_SKIP() << no_outside_data(name);
  const TempFolder temp;
  const fs::path slow = temp / "slow";
  fs::create_directories(slow);
  for (const char* part : {"rgb", "depth"}) fs::create_directory_symlink(dataset / part, slow / part);
  std::ofstream rgb(slow / "rgb.txt"), depth(slow / "depth.txt"), pairs(slow / "associations.txt");
  std::ifstream all(dataset / "associations.txt");
  std::string line;
  for (int row = 0; std::getline(all, line);) {
    if (line.empty() || line[0] == '#' || row++ % 3 != 0) continue;
    std::istringstream columns(line);
    std::string colour_stamp, colour, depth_stamp, map;
    columns >> colour_stamp >> colour >> depth_stamp >> map;
    rgb << colour_stamp << ' ' << colour << '\n';
    depth << depth_stamp << ' ' << map << '\n';
    pairs << line << '\n';
  }
  rgb.close(), depth.close(), pairs.close();
  const SlamRun run(slow, temp / "out", {"--camera", "fr1", "--detector", "motion"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), run.stats.at("frames"));
  EXPECT_LT(ape_of(dataset, run.out / "trajectory.txt"), 0.009);
}

}  // namespace
}  // namespace dkb::test
