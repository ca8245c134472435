// SPDX-License-Identifier: Apache-2.0
#include "report/run_report.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "report/charts.h"

namespace dkb::report {
namespace {

TEST(Base64, EncodesAsRfc4648Says) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("\xff\xfe\xfd"), "//79");
}

TEST(ChangedSettings, AreThoseThatDifferWithTheirWholeKey) {
  EXPECT_TRUE(changed_settings(Options()).empty());
  Options options;
  options.set("features.count", "950");
  options.set("experiment.smooth_trajectory", "true");  // as it is by default
  const auto changed = changed_settings(options);
  ASSERT_EQ(changed.size(), 2u);
  EXPECT_EQ(changed[0].key, "experiment.smooth_trajectory");
  EXPECT_EQ(changed[1].key, "features.count");
  EXPECT_EQ(changed[1].value, "950");
  EXPECT_EQ(changed[1].initial, "900");
  const auto of_preset = changed_settings(Options("orb"));
  EXPECT_EQ(of_preset[0].key, "preset");
  EXPECT_EQ(of_preset[0].value, "orb");
  EXPECT_EQ(of_preset[0].initial, "default");
}

TEST(UpAxis, IsWhereCamerasHaveTheirTop) {
  EXPECT_EQ(up_axis({Rigid3()}).axis, 1);  // the camera's own axes: y down
  EXPECT_TRUE(up_axis({Rigid3()}).negative);
  const Eigen::Quaterniond upright(Eigen::AngleAxisd(-M_PI / 2, Eigen::Vector3d::UnitX()));  // looks along y of a world
  EXPECT_EQ(up_axis({Rigid3(upright, Eigen::Vector3d::Zero())}).axis, 2);
  EXPECT_FALSE(up_axis({Rigid3(upright, Eigen::Vector3d::Zero())}).negative);
}

// A run of small images that wanders about, and is lost now and then.
struct LongRun {
  // `period` frames, of which the last fiftieth, at least one, is lost.
  LongRun(int frames, int period) {
    facts.camera.width = 32;
    facts.camera.height = 24;
    const GreyImage grey(32, 24, 100);
    const DepthImage depth(32, 24, 1.0F);
    ImageView grey_view{grey.data(), 32, 24, 0, PixelFormat::grey8},
        depth_view{depth.data(), 32, 24, 0, PixelFormat::depth_f32};
    for (int i = 0; i < frames; ++i) {
      const int64_t stamp = int64_t{1'000'000'000} + i * int64_t{33'333'333};
      const double t = i / 30.0;
      const Rigid3 pose(Eigen::Quaterniond::Identity(),
                        {3 * std::sin(t), 2 * std::sin(1.7 * t), 1 + std::cos(0.31 * t)});
      const Frame frame(facts.camera, {stamp, grey_view, depth_view});
      FrameResult result;
      result.frame = i;
      result.stamp_ns = stamp;
      result.state = i % period < period - std::max(1, period / 50) ? TrackingState::tracking : TrackingState::lost;
      result.inliers = 100 + i % 37;
      result.features.resize(30);
      result.tracking_ms = 8;
      result.keyframe = i % 7 == 0;
      if (result.state == TrackingState::tracking) result.world_from_cam = pose;
      log.frame(frame, result);
      if (result.keyframe) log.event({Event::Kind::keyframe, i, stamp, i / 7, i % 2 == 0 ? "adaptive" : "floor"});
      const double seconds = 1e-9 * static_cast<double>(stamp);
      truth.poses.push_back({seconds, "", pose});
      if (result.world_from_cam) facts.trajectory.push_back({seconds, "", pose});
    }
    truth.evaluation = evaluate(truth.poses, facts.trajectory);
  }
  RunLog log;
  ReportFacts facts;
  Truth truth;
};

TEST(RunReport, SizeHardlyGrowsWithTheFrames) {
  for (const int period : {2, 500}) {
    const LongRun run(60000, period);
    EXPECT_LE(run.log.pictures().size(), 25u);
    const std::string html = report_html(run.log, run.facts, run.truth);
    EXPECT_LT(html.size(), 2'000'000u);
    EXPECT_NE(html.find(fmt::format("And {} stretches more.", 60000 / period - 30)), std::string::npos);
  }
}

TEST(RunReport, NavigationLeadsToTheEvents) {
  LongRun run(300, 100);
  EXPECT_EQ(report_html(run.log, run.facts, run.truth).find("<a href=\"#events\">"), std::string::npos)
      << "there are none";
  run.log.event({Event::Kind::lost, 99, int64_t{4'266'666'634}, 0, "too few points"});
  const std::string html = report_html(run.log, run.facts, run.truth);
  EXPECT_NE(html.find("<a href=\"#events\">Events</a>"), std::string::npos);
  EXPECT_NE(html.find("<h2 id=\"events\">"), std::string::npos);
}

TEST(RunReport, NavigationLeadsToSectionsThatAreThereAlsoWithoutAPose) {
  LongRun run(100, 50);
  run.facts.trajectory.clear();
  run.truth = {};
  const std::string html = report_html(run.log, run.facts, run.truth);
  size_t links = 0;
  for (size_t at = 0; (at = html.find("<a href=\"#", at)) != std::string::npos; ++links) {
    at += 10;
    const std::string id = html.substr(at, html.find('"', at) - at);
    EXPECT_NE(html.find("<h2 id=\"" + id + "\">"), std::string::npos) << id;
  }
  EXPECT_GE(links, 3u);
}

TEST(RunReport, ThePoseIsWhatNoStageOfTrackingTakes) {
  LongRun run(100, 50);
  run.facts.wall_s = 1;
  for (const auto& [stage, ms] : {std::pair{"features", 1.0}, std::pair{"flow", 6.0}})
    run.facts.statistics.stages[stage] = {.mean_ms = ms, .count = 100};
  EXPECT_NE(report_html(run.log, run.facts, run.truth).find("flow alone 60 %"), std::string::npos);
}

TEST(TimeChart, ALevelAtTheTopIsNamedBelowItsLine) {
  TimeChart chart{"", "[ms]", {{"est", "tracking", {0, 1}, {5, 6}, {0, 1}}}, true, {{33.3, "the level"}}};
  const std::string svg = time_chart(chart, 1, {});
  double line = 0, text = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("y1=", svg.find("class=\"level\"")), "y1=\"%lf", &line), 1);
  const size_t label = svg.rfind("<text", svg.find("the level"));
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find(" y=", label), " y=\"%lf", &text), 1);
  EXPECT_GT(text, line + 10);
}

TEST(RunReport, ShowsTheMapAndTheGridFromAbove) {
  LongRun run(100, 50);
  EXPECT_EQ(report_html(run.log, run.facts, run.truth).find("<h2 id=\"map\">"), std::string::npos) << "there is none";
  for (int i = 0; i < 200; ++i) run.facts.map_points.emplace_back(0.05 * i, 1, 0.5 * std::sin(i));
  run.facts.keyframes = {{0, 0, 0}, {1, 0, 0}};
  std::string html = report_html(run.log, run.facts, run.truth);
  EXPECT_NE(html.find("<a href=\"#map\">Map</a>"), std::string::npos);
  EXPECT_NE(html.find("The map from above"), std::string::npos);
  EXPECT_EQ(html.find("Where a robot can drive"), std::string::npos);
  run.facts.grid.emplace();
  run.facts.grid->cells = Image<uint8_t>(2, 2, OccupancyGrid::kFree);
  html = report_html(run.log, run.facts, run.truth);
  EXPECT_NE(html.find("Where a robot can drive"), std::string::npos);
}

TEST(MapAbove, PointsOfALargeMapTakeNoMoreRoom) {
  MapAbove map{"x [m]", "y [m]", {}, {}, {"est", "path", {{0, 0, 0}, {5, 5, 0}}}};
  for (int i = 0; i < 300000; ++i) map.points.emplace_back(10 * std::sin(0.37 * i), 10 * std::sin(0.61 * i + 1), 0);
  EXPECT_LT(map_above(map).size(), 80000u);
}

TEST(MapAbove, AFewPointsFarAwayDoNotShrinkTheRest) {
  MapAbove map{"x [m]", "y [m]", {}, {}, {"est", "path", {{0, 0, 0}, {4, 3, 0}}}};
  for (int i = 0; i < 1000; ++i) map.points.emplace_back(4 * std::sin(i), 3 * std::cos(0.3 * i), 0);
  map.points.emplace_back(5000, 0, 0);
  EXPECT_NE(map_above(map).find(">2 m</text>"), std::string::npos) << "the bar that gives the scale";
}

TEST(GridAbove, CellsLieWhereTheyAre) {
  OccupancyGrid grid;
  grid.cell = 0.5;
  grid.cells = Image<uint8_t>(3, 2, OccupancyGrid::kUnknown);
  grid.cells(0, 0) = grid.cells(1, 0) = OccupancyGrid::kFree;
  grid.cells(2, 1) = OccupancyGrid::kOccupied;
  const std::string svg = grid_above(grid, {"est", "path", {{0.25, 0.75, 0}}});
  EXPECT_NE(svg.find("class=\"free\" d=\"M0 0h2v1h-2z\""), std::string::npos) << svg;
  EXPECT_NE(svg.find("class=\"occupied\" d=\"M2 1h1v1h-1z\""), std::string::npos);
  // The path's point lies in the middle of the first cell.
  double x = 0, y = 0, scale = 0, cx = 0, cy = 0;
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("translate("), "translate(%lf %lf) scale(%lf)", &x, &y, &scale), 3);
  ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("cx="), "cx=\"%lf\" cy=\"%lf\"", &cx, &cy), 2);
  EXPECT_NEAR(cx, x + 0.5 * scale, 0.1);
  EXPECT_NEAR(cy, y + 0.5 * scale, 0.1);
}

TEST(GridAbove, OfALargeGridObstaclesAreKept) {
  OccupancyGrid grid;
  grid.cells = Image<uint8_t>(2000, 2000, OccupancyGrid::kFree);
  for (int y = 0; y < 2000; ++y)
    for (int x = y % 3; x < 2000; x += 7) grid.cells(x, y) = OccupancyGrid::kUnknown;
  grid.cells(1000, 1001) = OccupancyGrid::kOccupied;
  const std::string svg = grid_above(grid, {"est", "path", {}});
  EXPECT_LT(svg.size(), 80000u);
  EXPECT_NE(svg.find("class=\"occupied\" d=\"M"), std::string::npos);
}

TEST(RunReport, FeaturesAreToldByWhatBecameOfThem) {
  const LongRun run(100, 50);
  const std::string html = report_html(run.log, run.facts, run.truth);
  EXPECT_NE(html.find("matched, not fitting"), std::string::npos);
  EXPECT_EQ(html.find(">features<"), std::string::npos) << "as many in every frame";
}

TEST(PathViews, EndAlsoFarFromTheOrigin) {
  SpacePath path{"est", "estimate", {}};
  for (int i = 0; i < 31; ++i) path.points.emplace_back(1e17, 0, 0);
  for (const std::string& view : path_views({path}, {1, true})) EXPECT_LT(view.size(), 20000u);
}

TEST(RunLog, KeepsPicturesSpreadOverTheRun) {
  const LongRun run(1000, 500);
  std::vector<size_t> even;  // the others are of frames that are no multiple of the step between these
  for (const OverlayPicture* p : run.log.pictures())
    if (p->row % 64 == 0) even.push_back(p->row);
  ASSERT_EQ(even.size(), 16u);
  for (size_t i = 0; i < even.size(); ++i) EXPECT_EQ(even[i], 64 * i);
  ASSERT_EQ(run.log.lost().size(), 2u);
  EXPECT_EQ(run.log.lost()[1].row, 990u);
}

TEST(RunLog, KeepsTheFrameOfFewestInliersAlsoWhereTheFirstHasNoPose) {
  Camera camera;
  camera.width = 32;
  camera.height = 24;
  const GreyImage grey(32, 24, 100);
  const DepthImage depth(32, 24, 1.0F);
  const ImageView grey_view{grey.data(), 32, 24, 0, PixelFormat::grey8},
      depth_view{depth.data(), 32, 24, 0, PixelFormat::depth_f32};
  RunLog log(1000);  // of five frames the first alone is kept whatever it shows
  for (const int inliers : {0, 100, 95, 40, 80}) {
    FrameResult result;
    result.stamp_ns = static_cast<int64_t>(1 + log.rows().size()) * 33'000'000;
    result.state = inliers == 0 ? TrackingState::lost : TrackingState::tracking;
    result.inliers = inliers;
    log.frame(Frame(camera, {result.stamp_ns, grey_view, depth_view}), result);
  }
  ASSERT_EQ(log.pictures().size(), 2u);
  EXPECT_EQ(log.pictures()[1]->row, 3u);
}

}  // namespace
}  // namespace dkb::report
