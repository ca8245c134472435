// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dkb/features/fast_corners.h"
#include "dkb/simulator/sensor.h"
#include "dkb/simulator/simulator.h"
#include "dkb/simulator/simulator_test_tools.h"

namespace dkb {
namespace {

SimulatorOptions named(const std::string& scene, uint64_t seed = 1) {
  SimulatorOptions o;
  o.scene = scene;
  o.seed = seed;
  return o;
}

TEST(Corridor, IsTwentyMetresOfFewCornersAndMuchDepth) {
  for (uint64_t seed = 1; seed <= 2; ++seed) {
    const Simulator s(named("corridor", seed));
    ASSERT_EQ(s.frames(), 900);
    const double way = (s.world_from_cam(899 / 30.0).translation - s.world_from_cam(0).translation).norm();
    EXPECT_NEAR(way, 20, 0.5);
    FastCornerFinder finder;
    int blank = 0, textured = 0, looked = 0;
    for (int i = 0; i < 900; i += 60, ++looked) {
      const SimulatedFrame f = s.render_without_true_depth(i);
      std::vector<PixelCorner> corners;
      finder.find(f.image.grey, 20, 16, corners);
      blank += corners.size() < 30;
      textured += corners.size() > 60;
      const auto holes = std::count(f.image.depth.data(), f.image.depth.data() + f.image.depth.size(), 0.0F);
      EXPECT_LT(static_cast<double>(holes), 0.5 * static_cast<double>(f.image.depth.size())) << i;
      EXPECT_GT(static_cast<double>(holes), 0.001 * static_cast<double>(f.image.depth.size())) << i;
    }
    EXPECT_GT(blank, 0.6 * looked);
    EXPECT_GT(textured, 0);
  }
}

TEST(Dim, IsTheRoomWithLittleContrastAndALongExposure) {
  const Simulator room(named("room")), dim(named("dim"));
  EXPECT_EQ(dim.exposure(), 0.030);
  EXPECT_EQ(dim.world_from_cam(3).translation, room.world_from_cam(3).translation);
  // 0.02 x 10 x 30 ms / 14 ms
  const double ratio = test::mean_grey(dim.render(30).image.grey) / test::mean_grey(room.render(30).image.grey);
  EXPECT_NEAR(ratio, 0.43, 0.02);
}

TEST(Expose, CountedPhotonsHaveAVarianceOfTheirNumber) {
  const std::vector<uint64_t> sum(200 * 200, 100 * 256 * (1ULL | 1ULL << 16 | 1ULL << 32));
  sim::Exposure exposure;
  exposure.photon_noise = 0.4;
  exposure.row_gain.assign(200, 0.5F);
  const ColourImage image = sim::expose(sum, 200, 200, exposure, 7);
  double square = 0, mean = 0;
  int n = 0;
  for (int y = 80; y < 120; ++y)  // the middle, where the lens does not darken
    for (int x = 80; x < 120; ++x, ++n) {
      mean += image(x, y).g;
      square += std::pow(image(x, y).g, 2);
    }
  mean /= n;
  EXPECT_NEAR(mean, 50, 1);
  EXPECT_NEAR(square / n - mean * mean, 0.4 * 50, 3);
}

}  // namespace
}  // namespace dkb
