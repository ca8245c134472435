// SPDX-License-Identifier: Apache-2.0
#include "dkb/evaluation/evaluation_report.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "dkb/evaluation/svg_drawing.h"
#include "dkb/util/errors.h"

namespace dkb {
namespace {

Evaluation example(const char* delta = "1f") {
  Trajectory truth, estimate;
  for (int i = 0; i < 30; ++i) {
    StampedPose p;
    p.timestamp = 0.1 * i + (i >= 20 ? 5.0 : 0.0);  // a gap after the 20th
    p.world_from_cam.translation = {0.1 * i, std::sin(0.3 * i), 0.01 * i};
    truth.push_back(p);
    p.world_from_cam.translation.z() += i % 2 == 0 ? 0.02 : -0.02;
    estimate.push_back(p);
  }
  return evaluate(truth, estimate, {.rpe_delta = parse_rpe_delta(delta)});
}

size_t occurrences(const std::string& text, const std::string& what) {
  size_t n = 0;
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
  return n;
}

TEST(EvaluationReport, JsonHasEveryFigure) {
  const Evaluation e = example();
  const auto json = nlohmann::json::parse(evaluation_json(e));
  EXPECT_EQ(json["matched"], 30);
  EXPECT_EQ(json["estimated"], 30);
  for (const char* kind : {"ape", "rpe"})
    for (const char* part : {"translation_m", "rotation_deg"})
      for (const char* figure : {"rmse", "mean", "median", "std", "min", "max"})
        EXPECT_TRUE(json[kind][part][figure].is_number()) << kind << part << figure;
  EXPECT_EQ(json["ape"]["translation_m"]["rmse"], e.ape.translation.rmse) << "to the last bit";
  EXPECT_EQ(json["rpe"]["pairs"], 29);
}

TEST(EvaluationReport, WhatCouldNotBeMeasuredIsNull) {
  const Evaluation e = example("1000m");
  const auto json = nlohmann::json::parse(evaluation_json(e));
  EXPECT_TRUE(json["rpe"]["translation_m"]["rmse"].is_null());
  EXPECT_NE(evaluation_table(e).find("no pair of poses is that far apart"), std::string::npos);
  EXPECT_NE(evaluation_svg(e).find("RPE (1000m) no pair of poses is that far apart"), std::string::npos);
}

TEST(EvaluationReport, ARotationErrorThatIsNotDeterminedIsToldSo) {
  Trajectory line;
  for (int i = 0; i < 31; ++i) line.push_back({0.1 * i, "", Rigid3({1, 0, 0, 0}, {0.1 * i, 0, 0})});
  const Evaluation e = evaluate(line, line);
  const auto json = nlohmann::json::parse(evaluation_json(e));
  EXPECT_EQ(json["ape"]["rotation_determined"], false);
  EXPECT_TRUE(json["ape"]["rotation_deg"]["rmse"].is_null());
  EXPECT_TRUE(json["ape"]["translation_m"]["rmse"].is_number());
  EXPECT_NE(evaluation_table(e).find("APE rotation      deg   not determined"), std::string::npos);
  EXPECT_NE(evaluation_svg(e).find("rotation not determined"), std::string::npos);
  EXPECT_TRUE(nlohmann::json::parse(evaluation_json(example()))["ape"]["rotation_determined"]);
}

TEST(EvaluationReport, WhatFiguresHideIsToldInALineEach) {
  EXPECT_TRUE(evaluation_warnings(example()).empty());
  const auto few = evaluation_warnings(example("5f"));
  ASSERT_EQ(few.size(), 1u);
  EXPECT_EQ(few[0], "RPE 5f: 5 pairs of poses tell little; take a shorter stretch, or all pairs with --rpe-all-pairs");
  Evaluation e = example();
  e.wrong_scale = 5;
  ASSERT_EQ(evaluation_warnings(e).size(), 1u);
  EXPECT_EQ(evaluation_warnings(e)[0], "the estimate is 5 times too small for the truth; is the depth factor right?");
  EXPECT_EQ(scale_text(0.001), "the estimate is 1000 times too large for the truth; is the depth factor right?");
  EXPECT_EQ(nlohmann::json::parse(evaluation_json(e))["wrong_scale"], 5);
  EXPECT_FALSE(nlohmann::json::parse(evaluation_json(example())).contains("wrong_scale"));
}

TEST(EvaluationReport, ARotationKnownTooRoughlySaysHowRoughly) {
  Evaluation e = example();
  const std::string doubt = "APE rotation may be the alignment's alone: the positions tell it to +- 12 deg";
  e.ape.rotation.rmse = 3, e.rotation_sd_deg = 12.3;
  EXPECT_NE(evaluation_table(e).find(doubt), std::string::npos);
  e.ape.rotation.rmse = 20;
  EXPECT_EQ(evaluation_table(e).find(doubt), std::string::npos);
}

TEST(EvaluationReport, TicksEndAlsoWhereDoublesAreTooCoarse) {
  EXPECT_EQ(svg::ticks({-0.1, 0.45}, 0.2), (std::vector<double>{0, 0.2, 0.4}));
  EXPECT_LE(svg::ticks({1e17, 1e17 + 64}, 1).size(), 20u);
  EXPECT_TRUE(svg::ticks({0, std::nan("")}, 1).empty());
  EXPECT_TRUE(svg::ticks({0, 1}, 0).empty());
  Trajectory far;
  for (int i = 0; i < 31; ++i) far.push_back({0.1 * i, "", Rigid3({1, 0, 0, 0}, {1e17, 0, i % 2 * 0.0})});
  EXPECT_LT(evaluation_svg(evaluate(far, far)).size(), 20000u);
}

TEST(EvaluationReport, TickTextsStayBesideTheirAxis) {
  EXPECT_EQ(svg::tick_text(0.3, 0.1), "0.3");
  EXPECT_EQ(svg::tick_text(-12.25, 0.05), "-12.25");
  EXPECT_EQ(svg::tick_text(2e-10, 1e-10), "2e-10");
  EXPECT_EQ(svg::tick_text(1.5e-10, 5e-11), "1.5e-10");
  EXPECT_EQ(svg::tick_text(0, 1e-10), "0");
  EXPECT_EQ(svg::tick_text(1e17, 2e4), "1.00e+17");
  EXPECT_EQ(svg::tick_text(4000000.05, 0.05), "4000000.05") << "a power of ten would not tell it from the next";
}

TEST(EvaluationReport, TableNamesApeAndUnits) {
  const std::string table = evaluation_table(example());
  EXPECT_EQ(table.rfind("30 poses matched (30 estimated, 30 true, stamps within 0.02 s)\n", 0), 0u) << table;
  EXPECT_NE(table.find("\nAPE translation     m "), std::string::npos) << table;
  EXPECT_NE(table.find("\nRPE 1f rotation   deg "), std::string::npos) << table;
  EXPECT_NE(table.find("\nRPE 1f of " + std::to_string(example().rpe_pairs.size()) + " pairs"), std::string::npos)
      << table;
}

TEST(EvaluationReport, PictureIsWholeAndEscapesNames) {
  const std::string svg = evaluation_svg(example(), "a<b> & \"c\"");
  EXPECT_EQ(svg.rfind("<svg xmlns=", 0), 0u);
  EXPECT_EQ(svg.substr(svg.size() - 7), "</svg>\n");
  EXPECT_NE(svg.find("a&lt;b&gt; &amp; &quot;c&quot;"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  // Truth and estimate in two projections, and the error, each in two stretches.
  EXPECT_EQ(occurrences(svg, "<polyline"), 10u);
  EXPECT_EQ(occurrences(svg, "<text"), occurrences(svg, "</text>"));
}

TEST(EvaluationReport, AStillCameraCanBeDrawn) {
  Trajectory still;
  for (int i = 0; i < 5; ++i) {
    StampedPose p;
    p.timestamp = i;
    still.push_back(p);
  }
  const std::string svg = evaluation_svg(evaluate(still, still));
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  EXPECT_LT(svg.size(), 50000u);
}

TEST(EvaluationReport, APathAloneIsDrawnTwice) {
  Trajectory path;
  for (int i = 0; i < 20; ++i) {
    StampedPose p;
    p.timestamp = i;
    p.world_from_cam.translation = {0.5 * i, 0, std::sin(i)};
    path.push_back(p);
  }
  const std::string svg = trajectory_svg(path, "a & b");
  EXPECT_EQ(svg.substr(svg.size() - 7), "</svg>\n");
  EXPECT_NE(svg.find("a &amp; b"), std::string::npos);
  EXPECT_EQ(occurrences(svg, "<polyline"), 2u);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_THROW(trajectory_svg({}), InputError);
  path.resize(1);
  EXPECT_EQ(trajectory_svg(path).find("inf"), std::string::npos);
}

}  // namespace
}  // namespace dkb
