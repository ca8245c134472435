// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_charts.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace dkb {
namespace {

size_t occurrences(const std::string& text, const std::string& what) {
  size_t n = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

void expect_whole(const std::string& svg) {
  EXPECT_EQ(svg.rfind("<svg xmlns=", 0), 0u);
  EXPECT_EQ(svg.substr(svg.size() - 7), "</svg>\n");
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  EXPECT_EQ(occurrences(svg, "<text"), occurrences(svg, "</text>"));
}

TEST(BarPanels, DrawABarPerValueAndAWhiskerPerInterval) {
  const double nan = std::nan(""), inf = std::numeric_limits<double>::infinity();
  const std::vector<BarPanel> panels = {
      {"walking <half>", {{"rmse", {Bar{0.3, {}}, Bar{0.01, std::pair{0.009, 0.012}}}}, {"max", {{}, Bar{nan, {}}}}}},
      {"empty", {{"rmse", {{}, {}}}}},
      {"zero", {{"rmse", {Bar{0, {}}, Bar{inf, {}}}}}}};
  const std::string svg = bar_panels_svg("APE", "APE [m]", {"ORB", "DKB"}, panels);
  expect_whole(svg);
  EXPECT_NE(svg.find("walking &lt;half&gt;"), std::string::npos);
  // The ground, two squares of the legend, three frames, and the bars of .3, .01 and 0.
  EXPECT_EQ(occurrences(svg, "<rect"), 1u + 2u + 3u + 3u);
  EXPECT_EQ(occurrences(svg, "<path"), 1u);
}

TEST(BarPanels, HeightsAreInProportion) {
  const std::string svg = bar_panels_svg("APE", "m", {"a", "b"}, {{"s", {{"rmse", {Bar{2, {}}, Bar{1, {}}}}}}});
  const auto height_of = [&](const char* colour) {
    const size_t at = svg.rfind(std::string("fill=\"") + colour);
    const size_t start = svg.rfind("height=\"", at) + 8;
    return std::stod(svg.substr(start));
  };
  EXPECT_NEAR(height_of("#1f6feb"), 2 * height_of("#f0883e"), 0.11);
}

TEST(ComparedPaths, DrawTheTruthDashedAndEverySystemTwice) {
  Trajectory truth, estimate;
  for (int i = 0; i < 40; ++i) {
    StampedPose p;
    p.timestamp = 0.1 * i;
    p.world_from_cam.translation = {0.1 * i, std::sin(0.3 * i), 0.01 * i};
    truth.push_back(p);
    if (i >= 5) estimate.push_back(p);
  }
  const Evaluation e = evaluate(truth, estimate);
  const std::string svg = compared_paths_svg("fr1/xyz", truth, {{"ORB", 0, e}, {"DKB", 3, e}});
  expect_whole(svg);
  EXPECT_EQ(occurrences(svg, "<polyline"), 6u);
  EXPECT_EQ(occurrences(svg, "stroke-dasharray"), 2u);
  EXPECT_NE(svg.find("#d1242f"), std::string::npos) << "the fourth system is red";
}

TEST(ComparedPaths, NothingToDrawIsStillAPicture) {
  expect_whole(compared_paths_svg("none", {}, {}));
}

}  // namespace
}  // namespace dkb
