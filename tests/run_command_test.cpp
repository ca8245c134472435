// SPDX-License-Identifier: Apache-2.0
// `dkb-slam run`, as its users start it.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <nlohmann/json.hpp>
#include <set>

#include "dkb/dataset/camera_file.h"
#include "dkb/dataset/image_codecs.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kSameBytes = {"trajectory.txt", "trajectory_online.txt", "keyframes.txt", "map.dkb",
                                             "map.ply",        "config.yaml",           "features.csv",  "debug.log"};

// Images of one's own making in place of the sequence's.
std::string black_jpeg() {
  return encode_jpeg(ColourImage(640, 480));
}
std::string empty_depth() {
  return encode_png(Image<uint16_t>(640, 480));
}

// Limits are per second and due frames follow the camera's rate: a slower camera works as a fast one does, up to the
// faster motion between its frames.
TEST(RunCommand, EverySecondOrThirdFrameIsEnough) {
  for (const size_t step : {1, 2, 3}) {
    const TempFolder folder;
    copy_sequence(folder.path(), kSequenceFrames, false);
    const auto rows = rows_of(folder / "associations.txt");
    std::string kept;
    for (size_t i = 0; i < rows.size(); i += step)
      kept += rows[i][0] + " " + rows[i][1] + " " + rows[i][2] + " " + rows[i][3] + "\n";
    write_text(folder / "associations.txt", kept);
    const SlamRun run(folder.path(), folder / "out");
    ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
    EXPECT_EQ(run.stats["tracked"], (rows.size() + step - 1) / step) << step;
    EXPECT_NE(read_text(run.out / "report.html").find("At " + std::to_string(30 / step) + " frames a second"),
              std::string::npos);
    EXPECT_LT(ape_of(sequence(), run.out / "trajectory.txt"), 0.005 * static_cast<double>(step)) << step;
  }
}

// Forty frames tell a part of it: the map was made of the same images.
TEST(RunCommand, LearnsHowLateDepthImagesAreStamped) {
  const auto learnt = [](double late) -> double {
    const TempFolder folder;
    copy_sequence(folder.path(), kSequenceFrames, false);
    std::string pairs;
    for (const auto& row : rows_of(folder / "associations.txt"))
      pairs += fmt::format("{} {} {:.6f} {}\n", row[0], row[1], std::stod(row[2]) + late, row[3]);
    write_text(folder / "associations.txt", pairs);
    const SlamRun run(folder.path(), folder / "out");
    EXPECT_EQ(run.finished.exit_code, 0) << run.finished.err;
    EXPECT_LT(ape_of(sequence(), run.out / "trajectory.txt"), 0.005);
    return run.stats.at("timing").at("depth_time_offset");
  };
  const double as_stamped = learnt(0);
  EXPECT_NEAR(as_stamped, 0, 0.003);
  EXPECT_LT(learnt(0.02), as_stamped - 0.003);
  EXPECT_GT(learnt(-0.02), as_stamped + 0.003);
}

TEST(RunCommand, WritesEveryFileOfTheContract) {
  const TempFolder temp;
  const SlamRun run(sequence(), temp / "out", {"--dump-features"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.finished.err, "") << "--quiet hides progress, and there is nothing to warn of";

  std::set<std::string> stamps;
  for (const auto& row : rows_of(sequence() / "rgb.txt")) stamps.insert(row[0]);
  for (const char* name : {"trajectory.txt", "trajectory_online.txt", "keyframes.txt"}) {
    const auto rows = rows_of(run.out / name);
    EXPECT_GT(rows.size(), 1U) << name;
    double before = 0;
    for (const auto& row : rows) {
      ASSERT_EQ(row.size(), 8U) << name;
      EXPECT_TRUE(stamps.contains(row[0])) << name << ": " << row[0] << " is not written as in rgb.txt";
      EXPECT_GT(std::stod(row[0]), before);
      before = std::stod(row[0]);
    }
  }
  EXPECT_EQ(rows_of(run.out / "trajectory.txt").size(), static_cast<size_t>(kSequenceFrames));
  const auto first = rows_of(run.out / "trajectory_online.txt").front();
  for (size_t i = 1; i < 7; ++i) EXPECT_EQ(std::stod(first[i]), 0) << "the world is the first camera";
  EXPECT_LT(ape_of(sequence(), run.out / "trajectory.txt"), 0.01);
  EXPECT_LT(ape_of(sequence(), run.out / "trajectory_online.txt"), 0.015);

  const nlohmann::json& s = run.stats;
  EXPECT_EQ(s.at("frames"), kSequenceFrames);
  EXPECT_EQ(s.at("tracked"), kSequenceFrames);
  EXPECT_EQ(s.at("lost"), 0);
  EXPECT_EQ(s.at("skipped"), 0);
  EXPECT_EQ(s.at("keyframes"), static_cast<int>(rows_of(run.out / "keyframes.txt").size()));
  EXPECT_GT(s.at("map_points"), 100);
  for (const char* key : {"maps", "merges", "loops", "relocalisations"})
    EXPECT_TRUE(s.at(key).is_number_integer()) << key;
  for (const char* key : {"startup_s", "wall_s", "cpu_s", "peak_rss_mb"}) EXPECT_GT(s.at(key).get<double>(), 0) << key;
  for (const char* stage : {"tracking", "features", "mapping", "local_ba", "keyframe_decision", "wait_mapper"})
    for (const char* figure : {"mean_ms", "median_ms", "p95_ms", "max_ms", "count"})
      EXPECT_TRUE(s.at("stages").at(stage).contains(figure)) << stage << "." << figure;
  EXPECT_EQ(s.at("stages").at("tracking").at("count"), kSequenceFrames);
  int by_rule = 0;
  for (const char* rule : {"first", "adaptive", "floor", "baseline"})
    by_rule += s.at("keyframe_rules").at(rule).get<int>();
  EXPECT_GE(by_rule, s.at("keyframes"));
  EXPECT_EQ(s.at("keyframe_rules").at("first"), 1);
  EXPECT_EQ(s.at("keyframe_tests").at("decisions"), kSequenceFrames - 1);
  EXPECT_GE(s.at("keyframe_tests").at("visibility"), s.at("keyframe_rules").at("adaptive"));
  EXPECT_TRUE(s.at("dynamic").contains("features_removed"));
  EXPECT_GT(s.at("timing").at("readout"), 0);
  EXPECT_TRUE(s.at("detector").contains("kind"));
  EXPECT_FALSE(s.contains("realtime")) << "a run of a dataset leaves nothing out";

  EXPECT_TRUE(read_text(run.out / "map.ply").starts_with("ply\n"));
  EXPECT_GT(fs::file_size(run.out / "map.dkb"), 1000U);
  EXPECT_NE(read_text(run.out / "config.yaml").find("mapper_latency"), std::string::npos);
  const std::string csv = read_text(run.out / "features.csv");
  EXPECT_TRUE(csv.starts_with("timestamp,x,y,state\n"));
  EXPECT_NE(csv.find(",used\n"), std::string::npos);
  EXPECT_EQ(csv.find(",dynamic\n"), std::string::npos);
}

TEST(RunCommand, TheDebugLogExplainsEveryDecision) {
  const TempFolder temp;
  const SlamRun run(sequence(), temp / "out", {"--debug-log"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  std::istringstream log(read_text(run.out / "debug.log"));
  int lines = 0, adaptive = 0, floor = 0, gate_open = 0;
  for (std::string line; std::getline(log, line); ++lines) {
    EXPECT_NE(line.find(" frame " + std::to_string(lines) + " tracking, "), std::string::npos) << line;
    if (lines == 0)
      EXPECT_NE(line.find("; keyframe (first): the map starts here"), std::string::npos) << line;
    else
      EXPECT_NE(line.find("parallax "), std::string::npos) << line;
    adaptive += line.find("; keyframe (adaptive): ") != std::string::npos;
    floor += line.find("; keyframe (floor): ") != std::string::npos;
    gate_open += line.find("): yes; ") != std::string::npos;
  }
  EXPECT_EQ(lines, kSequenceFrames);
  EXPECT_EQ(adaptive, run.stats.at("keyframe_rules").at("adaptive"));
  EXPECT_EQ(floor, run.stats.at("keyframe_rules").at("floor"));
  EXPECT_EQ(gate_open, run.stats.at("keyframe_tests").at("parallax"));
}

TEST(RunCommand, OneThreadAndManyGiveTheSameBytes) {
  const TempFolder temp;
  const SlamRun many(sequence(), temp / "many", {"--dump-features", "--debug-log"}),
      one(sequence(), temp / "one", {"--dump-features", "--debug-log", "--threads", "1"});
  ASSERT_EQ(many.finished.exit_code, 0) << many.finished.err;
  ASSERT_EQ(one.finished.exit_code, 0) << one.finished.err;
  for (const std::string& name : kSameBytes) EXPECT_EQ(read_text(many.out / name), read_text(one.out / name)) << name;
}

TEST(RunCommand, ItsConfigurationRepeatsTheRun) {
  const TempFolder temp;
  const SlamRun first(sequence(), temp / "first", {"--set", "features.count=600", "--max-frames", "15"});
  ASSERT_EQ(first.finished.exit_code, 0) << first.finished.err;
  EXPECT_NE(read_text(first.out / "config.yaml").find("600"), std::string::npos);
  const SlamRun again(sequence(), temp / "again",
                      {"--config", (first.out / "config.yaml").string(), "--max-frames", "15"});
  ASSERT_EQ(again.finished.exit_code, 0) << again.finished.err;
  for (const char* name : {"trajectory.txt", "map.dkb", "config.yaml"})
    EXPECT_EQ(read_text(first.out / name), read_text(again.out / name)) << name;
}

TEST(RunCommand, ChoosesFramesAndReplacesEarlierResults) {
  const TempFolder temp;
  const SlamRun first(sequence(), temp / "out", {"--max-frames", "12"});
  EXPECT_EQ(first.stats.at("frames"), 12);
  write_text(temp.path() / "out" / "mine.txt", "kept");
  const SlamRun second(sequence(), temp / "out", {"--start", "0.5", "--end", "0.9"});  // frames 15 ... 27 at 30 Hz
  ASSERT_EQ(second.finished.exit_code, 0) << second.finished.err;
  EXPECT_EQ(second.stats.at("frames"), 13);
  EXPECT_EQ(rows_of(second.out / "trajectory.txt").size(), 13U);
  EXPECT_EQ(read_text(temp.path() / "out" / "mine.txt"), "kept");
}

TEST(RunCommand, WhatSwitchesTheFilterOffWinsOverADetectorWithoutAnError) {
  const TempFolder temp;
  write_text(temp / "boxes.txt", "1 person 10 10 50 50\n");  // of another recording
  for (const char* off : {"--disable=dr", "--filter=none", "--preset=orb"}) {
    const Finished run = run_program({"run", sequence().string(), "--out", (temp / "out").string(), "--detector",
                                      "file", "--boxes", (temp / "boxes.txt").string(), "--quiet", off});
    EXPECT_EQ(run.exit_code, 0) << off;
    EXPECT_EQ(run.err, "") << off;
  }
}

TEST(RunCommand, WithoutRejectingMoversMasksAreNotReadBlanksOrNot) {
  const TempFolder temp;
  const SlamRun run(sequence(), temp / "out", {"--disable", "kf, dr", "--masks", temp / "none", "--max-frames", "3"});
  EXPECT_EQ(run.finished.exit_code, 0) << run.finished.err;
}

TEST(RunCommand, OfAPartMasksMayShowNobody) {
  const TempFolder temp;
  std::filesystem::create_directory(temp / "masks");
  const std::string last = rows_of(sequence() / "rgb.txt").back()[0];
  write_image_file(temp / "masks" / (last + ".png"), encode_png(GreyImage(640, 480, 0)));
  const SlamRun part(sequence(), temp / "out", {"--detector", "none", "--masks", temp / "masks", "--max-frames", "8"});
  EXPECT_EQ(part.finished.exit_code, 0) << part.finished.err;
  EXPECT_NE(part.finished.err.find("masks: no mask has the stamp of a frame"), std::string::npos) << part.finished.err;
  const SlamRun whole(sequence(), temp / "out", {"--detector", "none", "--masks", temp / "masks"});
  EXPECT_EQ(whole.finished.exit_code, 0) << whole.finished.err;
  EXPECT_NE(whole.finished.err.find("masks: 39 of 40 frames have no mask"), std::string::npos) << whole.finished.err;
}

TEST(RunCommand, BoxesWithoutAnImageAreCounted) {
  const TempFolder temp;
  const auto rows = rows_of(sequence() / "rgb.txt");
  const auto warned = [&](const std::function<std::string(size_t)>& stamp, const std::vector<std::string>& more) {
    std::string text;
    for (size_t i = 0; i < rows.size(); i += 2) text += stamp(i) + " person 10 10 50 50\n";
    write_text(temp / "boxes.txt", text);
    std::vector<std::string> options = {"--detector", "file", "--boxes", temp / "boxes.txt"};
    options.insert(options.end(), more.begin(), more.end());
    const SlamRun run(sequence(), temp / "out", options);
    EXPECT_EQ(run.finished.exit_code, 0) << run.finished.err;
    return run.finished.err;
  };
  const auto whole = [&](size_t i) { return rows[i][0]; };
  EXPECT_EQ(warned(whole, {"--quiet"}), "") << "images without people need no line";
  EXPECT_EQ(warned(whole, {"--quiet", "--start", "0.4", "--max-frames", "12"}), "") << "the others are of other frames";
  // Stamps with two decimals: of 33.3 ms apart, those at 0 and 0.2 s, 0.4 s ... are exact.
  const auto rounded = [&](size_t i) { return rows[i][0].substr(0, rows[i][0].find('.') + 3); };
  EXPECT_NE(warned(rounded, {"--quiet"}).find(" of 20 stamps belong to no image (within 2 ms)"), std::string::npos);
}

TEST(RunCommand, TheBoxesThatWereUsedServeAgain) {
  const TempFolder temp;
  const std::string stamp = rows_of(sequence() / "rgb.txt")[3][0];
  write_text(temp / "boxes.txt", stamp + " person 10 20 50 60.5 0.75\n");
  const SlamRun run(sequence(), temp / "out",
                    {"--detector", "file", "--boxes", temp / "boxes.txt", "--dump-boxes", "--max-frames", "6"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(read_text(run.out / "detections.txt"),
            "# rgb_timestamp class x y w h score\n" + stamp + " person 10.00 20.00 50.00 60.50 0.750\n");
  const SlamRun again(sequence(), temp / "again",
                      {"--detector", "file", "--boxes", run.out / "detections.txt", "--max-frames", "6"});
  EXPECT_EQ(read_text(run.out / "trajectory.txt"), read_text(again.out / "trajectory.txt"));
  const SlamRun without(sequence(), temp / "out", {"--max-frames", "6"});
  EXPECT_FALSE(fs::exists(run.out / "detections.txt")) << "one of an earlier run";
}

TEST(RunCommand, StatisticsTellWhatWasRun) {
  const TempFolder temp;
  const std::string stamp = rows_of(sequence() / "rgb.txt")[3][0];
  write_text(temp / "boxes.txt", stamp + " person 10 20 50 60\n");
  const SlamRun run(
      sequence(), temp / "out",
      {"--detector", "file", "--boxes", temp / "boxes.txt", "--skip-pairs", "1", "--end", "0.5", "--seed", "7"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("interrupted"), false);
  const auto& made = run.stats.at("run");
  EXPECT_EQ(made.at("program").get<std::string>().find(run_program({"--version"}).out.substr(9, 5)), 0u) << made;
  EXPECT_EQ(made.at("arguments")[0], "run");
  EXPECT_NE(std::find(made.at("arguments").begin(), made.at("arguments").end(), "--skip-pairs"),
            made.at("arguments").end());
  EXPECT_EQ(made.at("source"), sequence().string());
  EXPECT_EQ(made.at("camera").at("width"), 640);
  EXPECT_EQ(made.at("seed"), 7);
  EXPECT_EQ(made.at("skip_pairs"), 1);
  EXPECT_EQ(made.at("end"), 0.5);
  EXPECT_TRUE(made.at("max_frames").is_null());
  EXPECT_NEAR(run.stats.at("detector").at("rate_hz").get<double>(), 30, 0.5) << "a file answers every frame";
  const SlamRun none(sequence(), temp / "out", {"--detector", "none", "--max-frames", "6"});
  EXPECT_EQ(none.stats.at("detector").at("rate_hz"), 0);
}

TEST(RunCommand, GreyOfTwelveBitsIsWarnedOf) {
  const TempFolder temp;
  const auto warned = [&](int factor) {
    const fs::path folder = temp / std::to_string(factor);
    copy_sequence(folder, 6, true);
    for (const auto& row : rows_of(folder / "associations.txt")) {
      const GreyImage grey = read_picture(folder / row[1]).grey;
      Image<uint16_t> wide(grey.width(), grey.height());
      for (size_t i = 0; i < grey.size(); ++i) wide.data()[i] = static_cast<uint16_t>(factor * grey.data()[i]);
      fs::remove(folder / row[1]);
      write_image_file(folder / row[1], encode_png(wide));
    }
    return SlamRun(folder, temp / "out", {"--quiet"}).finished.err;
  };
  EXPECT_NE(warned(16).find("use the lower 12 alone"), std::string::npos) << "12 bits";
  EXPECT_EQ(warned(256).find("use the lower"), std::string::npos);
}

TEST(RunCommand, AWrongDepthFactorAndHiddenMarkersAreToldBesideTheError) {
  const TempFolder temp;
  const fs::path folder = temp / "sequence";
  copy_sequence(folder, 30, false);
  std::string truth = read_text(folder / "groundtruth.txt");
  truth.insert(truth.find('\n') + 1, "1.0 nan nan nan nan nan nan nan\n");
  write_text(folder / "groundtruth.txt", truth);
  std::string camera = read_text(folder / "camera.yaml");
  camera.replace(camera.find("depth_factor: 5000"), 18, "depth_factor: 7000");
  write_text(folder / "camera.yaml", camera);
  const SlamRun run(folder, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_NE(run.finished.err.find("groundtruth.txt: 1 rows with nan are left out"), std::string::npos)
      << run.finished.err;
  EXPECT_NE(run.finished.err.find("times too small for the truth; is the depth factor right?"), std::string::npos)
      << run.finished.err;
}

TEST(RunCommand, ShowsProgressUnlessQuiet) {
  const TempFolder temp;
  const Finished loud = run_program(
      {"run", sequence().string(), "--out", (temp / "out").string(), "--detector", "none", "--max-frames", "8"});
  EXPECT_EQ(loud.exit_code, 0);
  EXPECT_NE(loud.err.find("frame 8/8"), std::string::npos) << loud.err;
  EXPECT_EQ(loud.err.find('\r'), std::string::npos) << "plain lines where no terminal is";
  EXPECT_NE(loud.out.find("camera.yaml"), std::string::npos) << "which camera was chosen: " << loud.out;
}

TEST(RunCommand, PacedByTheStampsEveryFrameIsAccountedFor) {
  const TempFolder temp;
  const SlamRun run(sequence(), temp / "out", {"--realtime"});
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  const auto& s = run.stats;
  EXPECT_EQ(s.at("frames"), kSequenceFrames);
  EXPECT_EQ(s.at("tracked").get<int>() + s.at("lost").get<int>() + s.at("skipped").get<int>(), kSequenceFrames);
  EXPECT_EQ(s.at("realtime").at("dropped"), s.at("skipped"));
  for (const char* part : {"detection", "loop_search", "features"})
    EXPECT_GE(s.at("realtime").at("degraded_s").at(part), 0) << part;
  EXPECT_LT(ape_of(sequence(), run.out / "trajectory.txt"), 0.02);
}

TEST(RunCommand, GreyImagesFloatDepthAndHalfTheSizeWork) {
  const TempFolder temp;
  const fs::path folder = temp / "half";
  copy_sequence(folder, 15, true);
  CameraModel camera = Camera::load(folder / "camera.yaml");
  const CameraModel full = camera;
  camera.width /= 2;
  camera.height /= 2;
  camera.fx /= 2;
  camera.fy /= 2;
  camera.cx = (camera.cx - 0.5) / 2;
  camera.cy = (camera.cy - 0.5) / 2;
  write_text(folder / "camera.yaml", camera.to_yaml());
  for (const auto& row : rows_of(folder / "associations.txt")) {
    const GreyImage grey = read_picture(folder / row[1]).grey;
    const DepthImage depth = read_depth(folder / row[3], full);
    GreyImage small(camera.width, camera.height);
    DepthImage small_depth(camera.width, camera.height);
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        small(x, y) = static_cast<uint8_t>(
            (grey(2 * x, 2 * y) + grey(2 * x + 1, 2 * y) + grey(2 * x, 2 * y + 1) + grey(2 * x + 1, 2 * y + 1) + 2) /
            4);
        small_depth(x, y) = depth(2 * x, 2 * y);
      }
    write_text(folder / row[1], encode_png(small));  // a file's kind is told by its content
    write_text(folder / row[3], encode_tiff(small_depth));
  }
  const SlamRun run(folder, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), 15);
  EXPECT_LT(ape_of(folder, run.out / "trajectory.txt"), 0.02);
}

TEST(RunCommand, IsLostInTheDarkAndFoundAgain) {
  const TempFolder temp;
  const fs::path folder = temp / "dark";
  copy_sequence(folder, kSequenceFrames, true);
  const auto rows = rows_of(folder / "associations.txt");
  for (size_t i = 12; i < 17; ++i) write_text(folder / rows[i][1], black_jpeg());
  const SlamRun run(folder, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  // The first frame in which the view is back has to be confirmed by the next one.
  EXPECT_EQ(run.stats.at("lost"), 6);
  EXPECT_EQ(run.stats.at("tracked"), kSequenceFrames - 6);
  EXPECT_GE(run.stats.at("relocalisations"), 1);
  std::set<std::string> written;
  for (const auto& row : rows_of(run.out / "trajectory.txt")) written.insert(row[0]);
  for (size_t i = 0; i < rows.size(); ++i) EXPECT_EQ(written.contains(rows[i][0]), i < 12 || i >= 18) << "frame " << i;
  EXPECT_LT(ape_of(folder, run.out / "trajectory.txt"), 0.02);
}

TEST(RunCommand, SurvivesAStretchWithoutDepth) {
  const TempFolder temp;
  const fs::path folder = temp / "flat";
  copy_sequence(folder, kSequenceFrames, true);
  const auto rows = rows_of(folder / "associations.txt");
  for (size_t i = 12; i < 22; ++i) write_text(folder / rows[i][3], empty_depth());
  const SlamRun run(folder, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("frames"), kSequenceFrames);
  EXPECT_GE(run.stats.at("tracked"), kSequenceFrames - 10);
  const auto tracked = rows_of(run.out / "trajectory.txt");
  EXPECT_EQ(tracked.back()[0], rows.back()[0]);
  EXPECT_LT(ape_of(folder, run.out / "trajectory.txt"), 0.03);
}

// As drivers do that give colour at twice the rate of depth.
TEST(RunCommand, DepthThatIsGivenTwiceIsUsedOnce) {
  const TempFolder folder;
  copy_sequence(folder.path(), kSequenceFrames, true);
  std::string pairs;
  const auto rows = rows_of(folder / "associations.txt");
  for (size_t i = 0; i < rows.size(); ++i)
    pairs += fmt::format("{} {} {} {}\n", rows[i][0], rows[i][1], rows[i][2], rows[i - i % 2][3]);
  write_text(folder / "associations.txt", pairs);
  const SlamRun run(folder.path(), folder / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_NE(run.finished.err.find("frame 1: the depth image is the one of the frame before once more"),
            std::string::npos)
      << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), kSequenceFrames);
  EXPECT_LT(ape_of(sequence(), run.out / "trajectory.txt"), 0.005);
  for (const auto& row : rows_of(run.out / "keyframes.txt")) {
    const auto at = std::find_if(rows.begin(), rows.end(), [&](const auto& pair) { return pair[0] == row[0]; });
    EXPECT_EQ((at - rows.begin()) % 2, 0) << "a keyframe waits for depth";
  }
}

TEST(RunCommand, StartsOnceTheLensIsUncovered) {
  const TempFolder temp;
  const fs::path folder = temp / "covered";
  copy_sequence(folder, 16, true);
  const auto rows = rows_of(folder / "associations.txt");
  for (size_t i = 0; i < 6; ++i) write_text(folder / rows[i][1], black_jpeg());
  const SlamRun run(folder, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), 10);
  EXPECT_EQ(rows_of(run.out / "trajectory.txt").front()[0], rows[6][0]);
}

TEST(RunCommand, NeverSeeingAnythingIsAFailureThatSaysSo) {
  const TempFolder temp;
  const fs::path folder = temp / "black";
  copy_sequence(folder, 6, true);
  for (const auto& row : rows_of(folder / "associations.txt")) write_text(folder / row[1], black_jpeg());
  const SlamRun run(folder, temp / "out");
  EXPECT_EQ(run.finished.exit_code, 1);
  EXPECT_EQ(run.finished.error_lines(), 1U) << run.finished.err;
  EXPECT_EQ(run.stats.at("tracked"), 0);
}

TEST(RunCommand, ABadImageIsSkippedNamedAndCounted) {
  const TempFolder temp;
  const fs::path folder = temp / "bad";
  copy_sequence(folder, 20, true);
  const auto rows = rows_of(folder / "associations.txt");
  write_text(folder / rows[10][1], "");
  const std::string depth = read_text(folder / rows[14][3]);
  write_text(folder / rows[14][3], depth.substr(0, depth.size() / 2));
  fs::remove(folder / rows[16][1]);
  const SlamRun run(folder, temp / "out");
  ASSERT_EQ(run.finished.exit_code, 0) << run.finished.err;
  EXPECT_EQ(run.stats.at("skipped"), 3);
  EXPECT_EQ(run.stats.at("tracked"), 17);
  EXPECT_NE(run.finished.err.find("warning"), std::string::npos);
  EXPECT_NE(run.finished.err.find(fs::path(rows[10][1]).filename().string()), std::string::npos) << run.finished.err;
}

TEST(RunCommand, AnInterruptWritesWhatThereIs) {
  const TempFolder temp;
  const Endless endless(temp / "endless");
  const fs::path out = temp / "out";
  Program program(endless.run(out));
  while (program.err().find("frame 1/20") == std::string::npos && !program.ended()) pause_ms(5);
  ASSERT_FALSE(program.ended());
  kill(program.pid(), SIGINT);
  while (!program.ended()) endless.let_go(), pause_ms(5);
  const Finished finished = program.wait();
  EXPECT_EQ(finished.exit_code, 130) << finished.err;
  const auto stats = nlohmann::json::parse(read_text(out / "stats.json"));
  EXPECT_GE(stats.at("tracked"), 1);
  EXPECT_EQ(stats.at("interrupted"), true);
  EXPECT_LE(stats.at("frames"), 12) << "those that were offered: the pipe, and what was decoded beside it";
  EXPECT_EQ(rows_of(out / "trajectory.txt").size(), stats.at("tracked").get<size_t>());
  for (const char* name : {"trajectory_online.txt", "keyframes.txt", "map.dkb", "map.ply", "config.yaml"})
    EXPECT_TRUE(fs::exists(out / name)) << name;
}

}  // namespace
}  // namespace dkb::test
