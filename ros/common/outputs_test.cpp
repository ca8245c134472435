// SPDX-License-Identifier: Apache-2.0
#include "outputs.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dkb_ros {
namespace {

TEST(DrawFeatures, ColoursSayWhatBecameOfThem) {
  const std::vector<uint8_t> pixels(20 * 10 * 3, 7);
  dkb::FrameResult result;
  result.features.push_back({5, 5, dkb::FeatureState::used, dkb::FeatureReason::none});
  result.features.push_back({19.4F, 0, dkb::FeatureState::dynamic, dkb::FeatureReason::on_mover});
  const ColourImageOutput drawn = draw_features({pixels.data(), 20, 10, 0, dkb::PixelFormat::bgr8}, result);
  const auto at = [&](int x, int y) {
    const auto first = drawn.rgb.begin() + 3 * (20 * y + x);
    return std::vector<int>(first, first + 3);
  };
  EXPECT_EQ(at(5, 5), (std::vector<int>{0, 230, 0}));
  EXPECT_EQ(at(19, 0), (std::vector<int>{230, 0, 0}));
  EXPECT_EQ(at(10, 8), (std::vector<int>{7, 7, 7}));
}

TEST(Hindrance, SaysWhyTheImagesDoNotTellWhereTheCameraIs) {
  dkb::FrameResult result;
  EXPECT_EQ(hindrance_of(result), "not localised") << "no frame has come";
  result.state = dkb::TrackingState::tracking;
  EXPECT_EQ(hindrance_of(result), "");
  result.state = dkb::TrackingState::relocalised;
  EXPECT_EQ(hindrance_of(result), "");
  result.state = dkb::TrackingState::predicted;
  EXPECT_EQ(hindrance_of(result), "carried by a motion prior or depth alone");
  result.state = dkb::TrackingState::lost;
  EXPECT_EQ(hindrance_of(result), "not localised");
  result.ambiguous = true;
  EXPECT_NE(hindrance_of(result).find("looks alike"), std::string::npos);
}

TEST(Path, IsThinnedAndEndsWhereTheRobotIs) {
  std::vector<dkb::TrajectoryFrame> trajectory;
  for (int i = 0; i <= 100; ++i)
    trajectory.push_back({i, i, Rigid3(Eigen::Quaterniond::Identity(), {0.01 * i, 0, 0}), i < 10 ? 0 : 1});
  EXPECT_EQ(path_of(trajectory, Rigid3(), 0.2, 1).back().stamp_ns, 9) << "the map that was loaded";
  const auto path = path_of(trajectory, Rigid3(), 0.2);
  ASSERT_EQ(path.size(), 6u);  // 0.1, 0.3, 0.5, 0.7, 0.9 and the last, 1.0
  EXPECT_EQ(path.front().stamp_ns, 10);
  EXPECT_EQ(path.back().stamp_ns, 100);
}

TEST(LoadedMaps, AreFewerWhenTwoOfThemAreJoined) {
  // Two maps that were loaded, a keyframe each, and one that was begun beside them.
  std::vector<dkb::TrajectoryFrame> keyframes{{-9, 0, {}, 0}, {-1, 1, {}, 1}, {5, 2, {}, 2}, {7, 3, {}, 2}};
  EXPECT_EQ(loaded_maps(keyframes), 2);
  keyframes[1].map = 0, keyframes[2].map = keyframes[3].map = 1;
  EXPECT_EQ(loaded_maps(keyframes), 1) << "the new one has the number of one that was loaded";
  keyframes[2].map = keyframes[3].map = 0;
  EXPECT_EQ(loaded_maps(keyframes), 1);
  keyframes.erase(keyframes.begin(), keyframes.begin() + 2);
  EXPECT_EQ(loaded_maps(keyframes), 0) << "the world began anew";
}

TEST(Grid, IsTurnedIntoTheAxesOfTheMap) {
  // A floor 0.3 m below the map's origin, turned by 90 degrees against it: 4 x 2 cells of 0.1 m.
  dkb::OccupancyGrid grid;
  grid.cell = 0.1;
  grid.origin_x = 1, grid.origin_y = 0;
  grid.cells = dkb::Image<uint8_t>(4, 2, dkb::OccupancyGrid::kFree);
  grid.cells(3, 0) = dkb::OccupancyGrid::kOccupied;  // floor x 1.3 ... 1.4, y 0.1 ... 0.2
  grid.cells(0, 1) = dkb::OccupancyGrid::kUnknown;   // floor x 1.0 ... 1.1, y 0.0 ... 0.1
  const Rigid3 map_from_floor(Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)), {0, 0, -0.3});
  grid.floor_from_world = map_from_floor.inverse();
  const GridOutput out = grid_in_map(grid);
  EXPECT_NEAR(out.floor_z, -0.3, 1e-9);
  const auto at = [&](double x, double y) {
    const int column = static_cast<int>(std::floor((x - out.origin_x) / out.cell));
    const int row = static_cast<int>(std::floor((y - out.origin_y) / out.cell));
    return int{out.cells.at(static_cast<size_t>(row * out.width + column))};
  };
  // Floor (x, y) is map (-y, x).
  EXPECT_EQ(at(-0.15, 1.35), 100);
  EXPECT_EQ(at(-0.05, 1.05), -1);
  EXPECT_EQ(at(-0.05, 1.25), 0);
}

}  // namespace
}  // namespace dkb_ros
