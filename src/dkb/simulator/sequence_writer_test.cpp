// SPDX-License-Identifier: Apache-2.0
#include "dkb/simulator/sequence_writer.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/trajectory_file.h"
#include "dkb/dataset/tum_dataset.h"
#include "dkb/simulator/simulator_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_folder.h"

namespace dkb {
namespace {

namespace fs = std::filesystem;

SimulatorOptions small(const std::string& scene, int frames) {
  return test::small_images(scene, frames, 320, 240);
}

TEST(SequenceWriter, OneAndTwoThreadsWriteTheSameBytes) {
  const test::TempFolder folder;
  const Simulator s(small("crowd", 4));
  SequenceWriterOptions one, two;
  one.threads = 1;
  write_sequence(s, folder / "1", {}, one);
  write_sequence(Simulator(small("crowd", 4)), folder / "2", {}, two);
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder / "1")) {
    if (!entry.is_regular_file()) continue;
    ++files;
    EXPECT_EQ(read_file(entry.path()), read_file(folder / "2" / fs::relative(entry.path(), folder / "1")))
        << entry.path();
  }
  EXPECT_EQ(files, 3 * 4 + 7);
}

TEST(SequenceWriter, SequenceReadsBackAsATumDataset) {
  const test::TempFolder folder;
  const Simulator s(small("rush", 5));
  int reported = 0;
  write_sequence(s, folder.path(), [&](int n) { reported = n; });
  EXPECT_EQ(reported, 5);
  const TumDataset data = open_tum_dataset(folder.path());
  EXPECT_EQ(data.pairs.size(), 5U);
  EXPECT_EQ(read_trajectory(folder / "groundtruth.txt").size(), 5U);
  EXPECT_EQ(choose_camera("", folder.path()).camera.fx, s.camera().fx);
  for (const DatasetPair& p : data.pairs) EXPECT_TRUE(fs::exists(folder / "masks" / (p.stamp + ".png")));
}

TEST(SequenceWriter, WhatIsInterruptedDoesNotLookWhole) {
  const test::TempFolder folder;
  SimulatorOptions o = small("rush", 2);
  o.odometry_drift = 0.02;
  write_sequence(Simulator(o), folder.path());
  const auto stop = [](int) { throw InputError("interrupted"); };
  EXPECT_THROW(write_sequence(Simulator(small("room", 3)), folder.path(), stop), InputError);
  for (const char* list :
       {"associations.txt", "rgb.txt", "depth.txt", "groundtruth.txt", "boxes.txt", "movers.csv", "odometry.txt"})
    EXPECT_FALSE(fs::exists(folder / list)) << list;
}

TEST(SequenceWriter, WheelsThatTellTooLittleAreSaidToBeAsGood) {
  const test::TempFolder folder;
  SimulatorOptions o = small("room", 2);
  o.odometry_drift = -0.125;
  write_sequence(Simulator(o), folder.path());
  EXPECT_TRUE(read_file(folder / "odometry.txt").starts_with("# drift 0.125\n"));
}

TEST(SequenceWriter, OdometryOfAPathDriftsAboutTheVerticalOfItsWorld) {
  const test::TempFolder folder;
  // The world is that of an upright camera: its y axis points down.
  std::string path;
  for (int i = 0; i <= 100; ++i) path += std::to_string(0.02 * i) + " " + std::to_string(0.01 * i) + " 0 0 0 0 0 1\n";
  write_file_atomically(folder / "path.txt", path);
  SimulatorOptions o = small("room", 20);
  o.path = (folder / "path.txt").string();
  o.odometry_drift = 0.2;
  write_sequence(Simulator(o), folder / "made");
  const Trajectory odometry = read_trajectory(folder / "made/odometry.txt");
  const Eigen::Quaterniond turned =
      odometry.front().world_from_cam.rotation.conjugate() * odometry.back().world_from_cam.rotation;
  EXPECT_GT(turned.vec().norm(), 0.01);
  EXPECT_LT(turned.vec().normalized().y(), -0.99) << turned.vec().transpose();
}

TEST(SequenceWriter, FolderThatCannotBeMadeIsABadInput) {
  const test::TempFolder folder;
  std::ofstream(folder / "taken") << "";
  EXPECT_THROW(write_sequence(Simulator(small("rush", 1)), folder / "taken"), InputError);
}

}  // namespace
}  // namespace dkb
