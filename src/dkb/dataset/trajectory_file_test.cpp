// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

std::string error(const std::string& text) {
  return test::input_error_of([&] { parse_trajectory(text, "t.txt"); });
}

TEST(TrajectoryFile, ReadsRowsSortedByStampEqualStampsInOrder) {
  const Trajectory t = parse_trajectory(
      "# header\r\n2.50 1 2 3 0 0 0 1.009\r\n\r\n1.5 4 5 6 0 0 1 0  # a remark \n2.5 7 8 9 0 0 0 1", "t.txt");
  ASSERT_EQ(t.size(), 3u);
  EXPECT_EQ(t[0].stamp, "1.5");
  EXPECT_EQ(t[0].world_from_cam.rotation.z(), 1.0);
  EXPECT_EQ(t[1].stamp, "2.50");
  EXPECT_EQ(t[1].world_from_cam.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(t[1].world_from_cam.rotation.w(), 1.0) << "normalised";
  EXPECT_EQ(t[2].world_from_cam.translation, Eigen::Vector3d(7, 8, 9));
  EXPECT_TRUE(parse_trajectory("# nothing\n", "t.txt").empty());
}

TEST(TrajectoryFile, FaultsNameFileAndLine) {
  EXPECT_EQ(error("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n"),
            "t.txt:2: 7 of 8 columns; a row must be `timestamp tx ty tz qx qy qz qw`");
  EXPECT_EQ(error("1 0 nan 0 0 0 0 1\n"), "t.txt:1: ty \"nan\" is not a finite number");
  EXPECT_EQ(error("1 0 0 0 0 0 0 1,5\n"), "t.txt:1: qw \"1,5\" is not a number");
  EXPECT_EQ(error("1 0 0 0 0 0 0 0\n"),
            "t.txt:1: the quaternion is of length 0, not 1; a row must be `timestamp tx ty tz qx qy qz qw`");
  EXPECT_EQ(error("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0.5 1\n"),
            "t.txt:2: the quaternion is of length 1.118, not 1; a row must be `timestamp tx ty tz qx qy qz qw`");
  EXPECT_EQ(error("1 0 0 0 0 0 0 1 0.5\n"),
            "t.txt:1: 9 columns, not 8; a row must be `timestamp tx ty tz qx qy qz qw`");
}

// Its first eight numbers look like a row whose quaternion is none.
TEST(TrajectoryFile, KittisRowsAreNamed) {
  EXPECT_EQ(
      error("1 0 0 0.5 0 1 0 0 0 0 1 2\n"),
      "t.txt:1: 12 numbers a row, as in a KITTI file: it has no stamps; give a file with rows `timestamp tx ty tz "
      "qx qy qz qw`");
}

TEST(TrajectoryFile, WhatOtherToolsWriteIsRead) {
  const char* evo = "1.305031102175303936e+09 0.0e+00 1.5e-01 -2.0 0.0 0.0 0.7071 0.7071\n";
  const char* orb_slam = "1305031102.175304 0.0000000 0.1500000 -2.0000000 0.0000000 0.0000000 0.7071068 0.7071068\n";
  const char* motion_capture =
      "# ground truth trajectory\n# timestamp tx\n1305031102.1753 0 0.15 -2 0 0 0.71 0.71 \r\n";
  for (const char* text : {evo, orb_slam, motion_capture}) {
    const Trajectory t = parse_trajectory(text, "t.txt");
    ASSERT_EQ(t.size(), 1u);
    EXPECT_NEAR(t[0].timestamp, 1305031102.1753, 1e-4);
    EXPECT_EQ(t[0].world_from_cam.translation, Eigen::Vector3d(0, 0.15, -2));
    EXPECT_NEAR(t[0].world_from_cam.rotation.z(), std::sqrt(0.5), 1e-12);
  }
}

TEST(TrajectoryFile, WritesStampsAsReadAndNineDecimals) {
  StampedPose a;
  a.timestamp = 1.5, a.stamp = "1.500";
  a.world_from_cam = Rigid3(Eigen::Quaterniond(-0.5, 0.5, -0.5, 0.5), {1, -2.25, -1e-10});
  StampedPose b;
  b.timestamp = 1305031102.175304;
  EXPECT_EQ(trajectory_to_text({a, b}),
            "# timestamp tx ty tz qx qy qz qw\n"
            "1.500 1.000000000 -2.250000000 0.000000000 -0.500000000 0.500000000 -0.500000000 0.500000000\n"
            "1305031102.175304 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 0.000000000 1.000000000\n");
}

TEST(TrajectoryFile, WrittenFileReadsBackTheSame) {
  const std::filesystem::path path =
      std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_trajectory.txt");
  const Trajectory t = parse_trajectory("1.25 0.1 0.2 0.3 0.5 0.5 0.5 0.5\n3 -1 -2 -3 0 0 0 1\n", "t.txt");
  write_trajectory(path, t);
  EXPECT_EQ(trajectory_to_text(read_trajectory(path)), trajectory_to_text(t));
  std::filesystem::remove(path);
  EXPECT_THROW(read_trajectory(path), InputError);
  EXPECT_THROW(write_trajectory("/proc/none/t.txt", t), InputError);
}

TEST(TrajectoryFile, NineDecimalsAreWrittenAsTheyWereRead) {
  const std::string text =
      "# timestamp tx ty tz qx qy qz qw\n"
      "1700000001.033333 0.334790170 -0.150210960 -0.003578506 -0.036434337 -0.117017850 -0.076910178 0.989476723\n";
  EXPECT_EQ(trajectory_to_text(parse_trajectory(text, "t.txt")), text);
}

TEST(TrajectoryFile, RowsOfHiddenMarkersAreLeftOutOfATruthAlone) {
  const std::string text = "1 0 0 0 0 0 0 1\n2 nan nan nan 0 0 0 1\n3 0 0 0 -NaN 0 0 nan\n4 1 0 0 0 0 0 1\n";
  size_t hidden = 0;
  const Trajectory truth = parse_trajectory(text, "t.txt", &hidden);
  EXPECT_EQ(hidden, 2u);
  ASSERT_EQ(truth.size(), 2u);
  EXPECT_EQ(truth[1].timestamp, 4);
  EXPECT_EQ(error(text), "t.txt:2: tx \"nan\" is not a finite number");
  EXPECT_THROW(parse_trajectory("1 inf 0 0 0 0 0 1\n", "t.txt", &hidden), InputError);
  EXPECT_THROW(parse_trajectory("nan 0 0 0 0 0 0 1\n", "t.txt", &hidden), InputError) << "a stamp is never hidden";
}

TEST(TrajectoryFile, CommasBetweenColumnsAreNamed) {
  const std::string commas = "t.txt:1: commas separate the columns; spaces must: `timestamp tx ty tz qx qy qz qw`";
  EXPECT_EQ(error("1.5,0,0,0,0,0,0,1\n"), commas);
  EXPECT_EQ(error("1.5, 0, 0\n"), commas);
}

TEST(TrajectoryFile, OfTheTruthLiesInTheRecordingsFolder) {
  size_t hidden = 0;
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / (std::to_string(::getpid()) + "dkb_truth");
  EXPECT_FALSE(truth_beside(folder, &hidden));
  std::filesystem::create_directory(folder);
  EXPECT_FALSE(truth_beside(folder, &hidden));
  std::ofstream(folder / "groundtruth.txt") << "1 0 0 0 0 0 0 1\n";
  EXPECT_EQ(truth_beside(folder, &hidden).value().size(), 1u);
  std::ofstream(folder / "groundtruth.txt") << "nothing\n";
  EXPECT_THROW(truth_beside(folder, &hidden), InputError);
  std::filesystem::remove_all(folder);
}

TEST(TrajectoryFile, MutatedFilesThrowNothingButInputErrors) {
  Random random(41);
  const std::string original =
      "# timestamp\n1305031101.6759 1.4276 0.6365 1.7614 0.6610 0.5863 -0.2988 -0.3605\n"
      "1305031101.6858 1.4271 0.6368 1.7611 0.6616 0.5862 -0.2974 -0.3607\n";
  for (int i = 0; i < 4000; ++i) {
    try {
      for (const StampedPose& pose : parse_trajectory(mutated(original, random), "t.txt"))
        EXPECT_NEAR(pose.world_from_cam.rotation.norm(), 1.0, 1e-9);
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    }
  }
}

}  // namespace
}  // namespace dkb
