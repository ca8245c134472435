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

namespace dkb {
namespace {

namespace fs = std::filesystem;

SimulatorOptions small(const std::string& scene, int frames) {
  return test::small_images(scene, frames, 160, 120);
}

class SequenceWriter : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("dkb_sequence_writer_" + std::string(testing::UnitTest::GetInstance()->current_test_info()->name()));
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(SequenceWriter, OneAndTwoThreadsWriteTheSameBytes) {
  const Simulator s(small("crowd", 4));
  SequenceWriterOptions one, two;
  one.threads = 1;
  write_sequence(s, folder_ / "1", {}, one);
  write_sequence(Simulator(small("crowd", 4)), folder_ / "2", {}, two);
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "1")) {
    if (!entry.is_regular_file()) continue;
    ++files;
    EXPECT_EQ(read_file(entry.path()), read_file(folder_ / "2" / fs::relative(entry.path(), folder_ / "1")))
        << entry.path();
  }
  EXPECT_EQ(files, 3 * 4 + 7);
}

TEST_F(SequenceWriter, SequenceReadsBackAsATumDataset) {
  const Simulator s(small("rush", 5));
  int reported = 0;
  write_sequence(s, folder_, [&](int n) { reported = n; });
  EXPECT_EQ(reported, 5);
  const TumDataset data = open_tum_dataset(folder_);
  EXPECT_EQ(data.pairs.size(), 5U);
  EXPECT_EQ(read_trajectory(folder_ / "groundtruth.txt").size(), 5U);
  EXPECT_EQ(choose_camera("", folder_).camera.fx, s.camera().fx);
  for (const DatasetPair& p : data.pairs) EXPECT_TRUE(fs::exists(folder_ / "masks" / (p.stamp + ".png")));
}

TEST_F(SequenceWriter, FolderThatCannotBeMadeIsAnOutputError) {
  std::ofstream(folder_ / "taken") << "";
  EXPECT_THROW(write_sequence(Simulator(small("rush", 1)), folder_ / "taken"), OutputError);
}

}  // namespace
}  // namespace dkb
