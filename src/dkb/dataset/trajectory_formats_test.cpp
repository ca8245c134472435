// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/trajectory_formats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"
#include "dkb/util/test_folder.h"

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

TEST(TrajectoryFormats, NothingIsWrittenWithASign) {
  const Trajectory still = {{1, "1", {Eigen::Quaterniond(1, -1e-12, -0.0, 0), {-1e-12, -0.0, -4e-10}}}};
  for (const char* name : {"tum", "kitti", "euroc"}) {
    const std::string text = trajectory_to_text(still, trajectory_format_named(name, "format"));
    for (const char* zero : {"-0.000000000", "-0 ", "-0\n"}) EXPECT_EQ(text.find(zero), std::string::npos) << text;
  }
}

class SavedTrajectory : public ::testing::Test {
 protected:
  std::string saved(int map, TrajectoryFormat format, const std::vector<std::string>& stamps) const {
    save_trajectory(folder / "t", frames, map, format, stamps);
    return read_file(folder / "t");
  }
  // Frames 0 and 2 in the first map, frame 1 in the second, a keyframe of a loaded map.
  const std::vector<TrajectoryFrame> frames = {{2, 3'000'000'001, one_pose()[0].world_from_cam, 0},
                                               {0, 1'500'000'000, {}, 0},
                                               {1, 2'000'000'000, one_pose()[0].world_from_cam, 1},
                                               {-1, 1'000'000'000, {}, 0}};
  test::TempFolder folder;
};

// write_outputs() of the program writes trajectory_to_text() of trajectories_by_map().
TEST_F(SavedTrajectory, HasTheBytesOfTheProgramsFiles) {
  const std::vector<std::string> stamps = {"1.50", "2", "3.000000001"};
  const auto by_map = trajectories_by_map(frames, stamps);
  for (int map = 0; map < 2; ++map) {
    const Trajectory& t = by_map[static_cast<size_t>(map)];
    EXPECT_EQ(saved(map, TrajectoryFormat::tum, stamps), trajectory_to_text(t));
    EXPECT_EQ(saved(map, TrajectoryFormat::kitti, stamps), trajectory_to_kitti(t));
    EXPECT_EQ(saved(map, TrajectoryFormat::euroc, stamps), trajectory_to_euroc(t));
  }
  EXPECT_EQ(saved(2, TrajectoryFormat::tum, stamps), trajectory_to_text({})) << "it has no pose yet";
}

TEST_F(SavedTrajectory, HasStampsByTheirNanosecondsWhereNoneAreGiven) {
  EXPECT_EQ(saved(0, TrajectoryFormat::tum, {}),
            trajectory_to_text(trajectories_by_map(frames, {"1.500000", "2.000000", "3.000000001"})[0]));
}

TEST_F(SavedTrajectory, AFrameWithoutAStampIsAnInputError) {
  EXPECT_EQ(test::input_error_of([&] {
              saved(0, TrajectoryFormat::tum, {"1.5", "2"});
            }),
            "stamps: frame 2 has none; there are 2");
}

}  // namespace
}  // namespace dkb
