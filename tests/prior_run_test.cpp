// SPDX-License-Identifier: Apache-2.0
// `dkb-slam run --prior-file`, on a sequence with people, black frames and wheels.
#include <gtest/gtest.h>

#include <cmath>

#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

// 80 frames of a crowd, of which the 20 from second 1.5 on are black; wheels that are off by 1 %.
fs::path dark_sequence() {
  return simulated(DKB_TEST_DARK, {"--scene", "crowd", "--seed", "3", "--frames", "80", "--blackout", "1.5,0.65",
                                   "--odometry", "0.01"});
}

TEST(RunWithPrior, EveryFrameHasAPoseAlsoInTheDarkAndThreadsDoNotChangeAByte) {
  const TempFolder folder;
  const fs::path dark = dark_sequence();
  const std::vector<std::string> prior = {"--detector", "motion", "--prior-file", (dark / "odometry.txt").string()};
  const SlamRun run(dark, folder / "a", prior);
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats["tracked"], 80);
  EXPECT_EQ(run.stats["predicted"], 20);
  EXPECT_EQ(run.stats["lost"], 0);
  EXPECT_EQ(rows_of(run.out / "trajectory.txt").size(), 80U);
  EXPECT_EQ(rows_of(run.out / "trajectory_online.txt").size(), 80U);
  EXPECT_LT(ape_of(dark, run.out / "trajectory.txt"), 0.02);
  auto single = prior;
  single.insert(single.end(), {"--threads", "1"});
  const SlamRun again(dark, folder / "b", single);
  for (const char* name : {"trajectory.txt", "trajectory_online.txt", "map.dkb", "movers.csv"})
    EXPECT_TRUE(read_text(run.out / name) == read_text(again.out / name)) << name;

  const SlamRun without(dark, folder / "c", {"--detector", "motion"});
  EXPECT_EQ(without.stats["predicted"], 0);
  EXPECT_EQ(without.stats["lost"].get<int>() + without.stats["tracked"].get<int>(), 80);
  EXPECT_GE(without.stats["lost"], 20);
}

TEST(RunWithPrior, TheSimulatorsWheelsAreOffByAsMuchAsWasAsked) {
  const auto odometry = rows_of(dark_sequence() / "odometry.txt"), truth = rows_of(dark_sequence() / "groundtruth.txt");
  ASSERT_EQ(odometry.size(), truth.size());
  const auto length = [](const std::vector<std::vector<std::string>>& rows) {
    double sum = 0;
    for (size_t i = 1; i < rows.size(); ++i) {
      double square = 0;
      for (size_t k = 1; k <= 3; ++k) square += std::pow(std::stod(rows[i][k]) - std::stod(rows[i - 1][k]), 2);
      sum += std::sqrt(square);
    }
    return sum;
  };
  EXPECT_NEAR(length(odometry) / length(truth), 1.01, 1e-3);
}

TEST(RunWithPrior, AFileThatTellsNoMotionIsRefused) {
  const TempFolder folder;
  for (const auto& [text, message] : std::vector<std::pair<std::string, std::string>>{
           {"", "holds 0 poses"}, {"1 2 3\n", "odometry.txt:1: "}, {"# drift x\n", "odometry.txt:1: drift"}}) {
    write_text(folder / "odometry.txt", text);
    const Finished run = run_program({"run", sequence().string(), "--out", (folder / "out").string(), "--prior-file",
                                      (folder / "odometry.txt").string()});
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_EQ(run.error_lines(), 1U) << run.err;
    EXPECT_NE(run.err.find(message), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(folder / "out"));
  }
}

TEST(Simulate, ABlackoutThatIsNoTimeIsRefused) {
  const TempFolder folder;
  for (const char* value : {"-1,2", "1,-2", "1,nan"}) {
    const Finished run =
        run_program({"simulate", "--out", (folder / "s").string(), std::string("--blackout=") + value});
    EXPECT_EQ(run.exit_code, 2) << value;
    EXPECT_NE(run.err.find("--blackout "), std::string::npos) << run.err;
  }
}

}  // namespace
}  // namespace dkb::test
