// SPDX-License-Identifier: Apache-2.0
// `dkb-slam bench` on a tiny simulated suite: reports, resuming, rows of runs that crash, shards, bad input.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

// The shared sequence by its path, so that nothing has to be drawn.
std::string suite_text(const std::string& more = "") {
  return "name: tiny\nseeds: 2\nmax_frames: 6\nreference: ORB\nsequences:\n  short: {path: " + sequence().string() +
         "}\nvariants:\n  ORB: {preset: orb}\n  default: {detector: none}\n" + more;
}

class Bench : public ::testing::Test {
 protected:
  fs::path suite(const std::string& text) {
    write_text(temp_ / "tiny.yaml", text);
    return temp_ / "tiny.yaml";
  }
  Finished bench(std::vector<std::string> arguments, long max_file_size = -1) {
    arguments.insert(arguments.begin(), {"bench", "--quiet"});
    return run_program(arguments, max_file_size);
  }
  std::string out(const std::string& name = "out") { return (temp_ / name).string(); }
  nlohmann::json results(const std::string& name = "out") {
    return nlohmann::json::parse(read_text(temp_ / name / "results.json"));
  }
  static size_t records(const fs::path& folder) {
    size_t n = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder / "runs"))
      n += entry.path().extension() == ".json";
    return n;
  }
  // A dkb-slam that does `instead` (shell) for runs of seed 2 of variant ORB.
  std::string program_that(const std::string& instead) {
    const fs::path file = temp_ / "program";
    write_text(file, "#!/bin/sh\ncase \"$*\" in *'--preset orb --seed 2'*) " + instead + " ;; esac\nexec '" +
                         std::string(DKB_SLAM_EXECUTABLE) + "' \"$@\"\n");
    fs::permissions(file, fs::perms::owner_all);
    return file.string();
  }
  TempFolder temp_;
};

TEST_F(Bench, ReportsEveryRunAndDoesNotRepeatIt) {
  const fs::path file = suite(suite_text());
  const Finished first = bench({file.string(), "--out", out()});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(records(temp_ / "out"), 4u);
  const auto cells = results()["cells"];
  ASSERT_EQ(cells.size(), 2u);
  for (const auto& cell : cells) {
    EXPECT_EQ(cell["runs"].size(), 2u);
    for (const auto& run : cell["runs"]) {
      EXPECT_EQ(run["failure"], "");
      EXPECT_EQ(run["frames"], 6);
      EXPECT_EQ(run["tracked"], 6);
      EXPECT_LT(run["ape"]["translation_m"]["rmse"], 0.05);
      EXPECT_GT(run["ape"]["translation_m"]["std"], 0);
      EXPECT_EQ(run["rpe"]["translation_m"]["count"], 5) << "over one frame";
      EXPECT_EQ(run["scored"], 6);
      EXPECT_EQ(run["maps"], 1);
      EXPECT_GT(run["map_bytes"], 1000);
      EXPECT_GT(run["machine"]["tracking_ms"], 0);
    }
    EXPECT_EQ(cell["scored_share"], 1);
    EXPECT_GT(cell["rpe_m"], 0);
    EXPECT_GT(cell["ape_std_m"], 0);
    EXPECT_NE(cell["runs"][0]["ape"], cell["runs"][1]["ape"]) << "seed 2 leaves out the first pair";
  }
  const std::string markdown = read_text(temp_.path() / "out" / "results.md");
  for (const char* says : {"| short | ORB | 2 | 6 |", "## Against ORB", "## Times and memory", "## Errors by sequence",
                           "| short | APE RMSE [m] |"})
    EXPECT_NE(markdown.find(says), std::string::npos) << says;
  EXPECT_NE(read_text(temp_.path() / "out" / "report.html").find("<svg"), std::string::npos);
  for (const char* plot : {"ape.svg", "short-bars.svg", "short-paths.svg"})
    EXPECT_TRUE(fs::exists(temp_.path() / "out" / "plots" / plot)) << plot;
  EXPECT_FALSE(fs::exists(temp_.path() / "out" / "work")) << "nothing is left of the runs";

  const Finished again = bench({file.string(), "--out", out()});
  EXPECT_EQ(again.exit_code, 0) << again.err;
  EXPECT_NE(again.out.find("0 runs done, 0 of them failed; 4 were there already"), std::string::npos) << again.out;
  EXPECT_EQ(read_text(temp_.path() / "out" / "results.md"), markdown);
}

TEST_F(Bench, ARunThatCrashesIsARowThatSaysSo) {
  const fs::path file = suite(suite_text());
  const std::string crashing = program_that("echo 'error: about to fall' >&2; kill -SEGV $$");
  const Finished run = bench({file.string(), "--out", out(), "--program", crashing});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const auto runs = results()["cells"][0]["runs"];
  ASSERT_EQ(runs.size(), 2u);
  EXPECT_EQ(runs[0]["failure"], "");
  const std::string failure = runs[1]["failure"];
  EXPECT_NE(failure.find("signal 11"), std::string::npos) << failure;
  EXPECT_NE(failure.find("about to fall"), std::string::npos) << failure;
  EXPECT_NE(read_text(temp_.path() / "out" / "results.md").find("| short | ORB | 2 | crashed: signal 11"),
            std::string::npos);
  const Finished retry = bench({file.string(), "--out", out(), "--retry"});
  EXPECT_NE(retry.out.find("1 runs done, 0 of them failed; 3 were there already"), std::string::npos) << retry.out;
}

TEST_F(Bench, ARunThatFailsBeforeItWritesIsARowAndTheOthersGoOn) {
  const fs::path file = suite(suite_text());
  const std::string failing = program_that("echo 'error: no memory' >&2; exit 1");
  const Finished run = bench({file.string(), "--out", out(), "--program", failing});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(records(temp_ / "out"), 4u);
  EXPECT_EQ(results()["cells"][0]["runs"][1]["failure"], "no memory");
}

TEST_F(Bench, IsAFailureWhereEveryRunFailed) {
  write_text(temp_ / "failing", "#!/bin/sh\nexit 3\n");
  fs::permissions(temp_ / "failing", fs::perms::owner_all);
  const Finished run = bench({suite(suite_text()).string(), "--out", out(), "--program", out("failing")});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_TRUE(fs::exists(temp_.path() / "out" / "results.md"));
}

TEST_F(Bench, ASuitesDetectorIsNotThatOfTheEnvironment) {
  const fs::path file =
      suite("seeds: 1\nmax_frames: 4\nsequences:\n  short: {path: " + sequence().string() + "}\nvariants:\n  plain:\n");
  const Finished run =
      run_program({"bench", "--quiet", file.string(), "--out", out()}, -1, {"DKB_SLAM_MODEL=/nowhere/model.onnx"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.out.find("1 runs done, 0 of them failed"), std::string::npos) << run.out;
}

TEST_F(Bench, ARunThatHangsIsEnded) {
  const fs::path file = suite("timeout: 5\n" + suite_text());  // [s] the other runs end long before
  const Finished run =
      bench({file.string(), "--out", out(), "--variant", "ORB", "--program", program_that("exec sleep 600")});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string failure = results()["cells"][0]["runs"].back()["failure"];
  EXPECT_EQ(failure.rfind("hung", 0), 0u) << failure;
}

TEST_F(Bench, ABenchThatIsKilledGoesOnWhereItStopped) {
  const fs::path file = suite(suite_text());
  Program killed(
      {"bench", file.string(), "--out", out(), "--quiet", "--jobs", "1", "--program", program_that("exec sleep 600")});
  while (!fs::exists(temp_.path() / "out" / "runs" / "short" / "ORB" / "seed-1.json"))
    ASSERT_FALSE(killed.ended()) << killed.err();
  kill(killed.pid(), SIGKILL);
  killed.wait();
  EXPECT_EQ(records(temp_ / "out"), 1u);
  const Finished rest = bench({file.string(), "--out", out()});
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_NE(rest.out.find("3 runs done, 0 of them failed; 1 were there already"), std::string::npos) << rest.out;
  EXPECT_FALSE(fs::exists(temp_.path() / "out" / "work"));
}

TEST_F(Bench, AnInterruptedBenchSaysHowToGoOn) {
  const fs::path file = suite(suite_text());
  Program bench_run(
      {"bench", file.string(), "--out", out(), "--quiet", "--jobs", "1", "--program", program_that("exec sleep 600")});
  while (!fs::exists(temp_.path() / "out" / "runs" / "short" / "ORB" / "seed-1.json"))
    ASSERT_FALSE(bench_run.ended()) << bench_run.err();
  kill(bench_run.pid(), SIGTERM);
  const Finished end = bench_run.wait();
  EXPECT_EQ(end.exit_code, 130);
  EXPECT_NE(end.err.find("to go on"), std::string::npos) << end.err;
  EXPECT_EQ(records(temp_ / "out"), 1u);
}

TEST_F(Bench, MergedShardsEqualTheWhole) {
  const fs::path file = suite(suite_text());
  ASSERT_EQ(bench({file.string(), "--out", out("whole"), "--no-times"}).exit_code, 0);
  fs::create_directory(temp_ / "parts");
  for (const char* shard : {"1", "2", "3"}) {
    const Finished part = bench({file.string(), "--shard", std::string(shard) + "/3", "--out",
                                 (temp_ / "parts" / ("part" + std::string(shard))).string()});
    ASSERT_EQ(part.exit_code, 0) << part.err;
    EXPECT_FALSE(fs::exists(temp_ / "parts" / ("part" + std::string(shard)) / "results.md"));
  }
  const Finished merged = bench({"--merge", (temp_ / "parts").string(), "--out", out("merged"), "--no-times"});
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_NE(merged.out.find("4 of 4 runs"), std::string::npos) << merged.out;
  for (const char* name : {"results.md", "report.html", "results.json"})
    EXPECT_EQ(read_text(temp_ / "whole" / name), read_text(temp_ / "merged" / name)) << name;
  for (const auto& plot : fs::directory_iterator(temp_ / "whole" / "plots"))
    EXPECT_EQ(read_text(plot.path()), read_text(temp_ / "merged" / "plots" / plot.path().filename().string()));
}

TEST_F(Bench, ATruthWithHiddenMarkersIsScored) {
  const fs::path folder = temp_ / "data";
  copy_sequence(folder, 6, false);
  write_text(folder / "groundtruth.txt", read_text(folder / "groundtruth.txt") + "1e9 nan nan nan nan nan nan nan\n");
  const Finished run = bench(
      {suite("seeds: 1\nsequences:\n  short: {path: " + folder.string() + "}\nvariants:\n  plain: {detector: none}\n")
           .string(),
       "--out", out()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(results()["cells"][0]["runs"][0]["scored"], 6);
  EXPECT_TRUE(fs::exists(temp_.path() / "out" / "plots" / "short-paths.svg"));
}

TEST_F(Bench, TheCamerasFileIsBesideTheSuite) {
  fs::copy_file(sequence() / "camera.yaml", temp_ / "mine.yaml");
  const std::string text = "seeds: 1\nmax_frames: 3\nsequences:\n  short: {path: " + sequence().string() +
                           ", camera: mine.yaml}\nvariants:\n  plain: {detector: none}\n";
  const Finished run = bench({suite(text).string(), "--out", out()});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(results()["cells"][0]["runs"][0]["failure"], "");
  const Finished gone =
      bench({suite("sequences:\n  short: {path: " + sequence().string() + ", camera: gone.yaml}\nvariants:\n  plain:\n")
                 .string(),
             "--out", out("new")});
  EXPECT_EQ(gone.exit_code, 2);
  EXPECT_NE(gone.err.find((temp_ / "gone.yaml").string() + " does not exist"), std::string::npos) << gone.err;
}

TEST_F(Bench, LabelsOfANetworkAreBesideTheSuite) {
  write_text(temp_ / "net.onnx", "none");
  const std::string text = "seeds: 1\nmax_frames: 3\nsequences:\n  short: {path: " + sequence().string() +
                           "}\nvariants:\n  plain: {detector: yolo, model: net.onnx, labels: names.txt}\n";
  const Finished run = bench({suite(text).string(), "--out", out()});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find((temp_ / "names.txt").string() + " does not exist"), std::string::npos) << run.err;
}

TEST_F(Bench, WhatNobodyChoseIsNotMissing) {
  const std::string text = "seeds: 1\nmax_frames: 4\nsequences:\n  short: {path: " + sequence().string() +
                           "}\nvariants:\n  a:\n  b: {get: set it}\n  c: {get: set it}\n";
  const auto report = [&](const std::string& variant) {
    const Finished run = bench({suite(text).string(), "--out", out(), "--variant", variant});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return read_text(temp_.path() / "out" / "results.md");
  };
  const std::string one = report("a");
  EXPECT_EQ(one.find("variant b"), std::string::npos) << one;
  EXPECT_EQ(one.find("not run"), one.find("not run\n")) << "but for the title of that section";
  EXPECT_NE(one.find("1 of 3 variants"), std::string::npos) << one;
  EXPECT_EQ(read_text(temp_.path() / "out" / "plots" / "ape.svg").find(">b<"), std::string::npos);
  const std::string two = report("b");
  EXPECT_NE(two.find("2 of 3 variants"), std::string::npos) << "what was chosen in a folder adds up";
  EXPECT_NE(two.find("| short | a |"), std::string::npos);
}

TEST_F(Bench, DrawsSimulatedSequencesAndNamesWhatIsMissing) {
  const std::string text =
      "seeds: 1\nroot: ${DKB_BENCH_TEST_UNSET}\nsequences:\n  drawn: {simulate: {scene: room, people: 0, frames: 4}}\n"
      "  away: {path: away, get: ask for it}\nvariants:\n  ORB: {preset: orb}\n";
  const Finished run = bench({suite(text).string(), "--out", out()});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.err.find("left out: sequence away: the environment variable DKB_BENCH_TEST_UNSET is not set"),
            std::string::npos)
      << run.err;
  EXPECT_NE(run.err.find("ask for it"), std::string::npos) << run.err;
  EXPECT_EQ(results()["cells"][0]["runs"][0]["frames"], 4);
  EXPECT_NE(read_text(temp_.path() / "out" / "results.md").find("| sequence away | all | ask for it |"),
            std::string::npos);
}

TEST_F(Bench, BadInputIsOneLineAndExitCodeTwo) {
  const std::string good = suite(suite_text()).string();
  ASSERT_EQ(bench({good, "--out", out(), "--variant", "default"}).exit_code, 0);
  const std::string kept = read_text(temp_.path() / "out" / "results.json");
  write_text(temp_ / "key.yaml", suite_text("seedz: 3\n"));
  write_text(temp_ / "other.yaml",
             "name: other\nsequences: {a: {path: " + sequence().string() + "}}\nvariants: {v: }\n");
  write_text(temp_ / "gone.yaml", "sequences: {a: {path: nowhere}}\nvariants: {v: }\n");
  fs::create_directory(temp_ / "full");
  write_text(temp_ / "full" / "letter", "mine");
  fs::create_directory(temp_ / "empty");
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{}, "suite"},
      {{out("none.yaml")}, "none.yaml"},
      {{out("key.yaml"), "--out", out("new")}, "did you mean \"seeds\"?"},
      {{out("other.yaml"), "--out", out()}, "another suite"},
      {{out("gone.yaml"), "--out", out("new")}, "nowhere"},
      {{good, "--out", out("full")}, "not empty"},
      {{good, "--out", out(), "--seeds", "3"}, "another suite"},
      {{good, "--out", out(), "--sequence", "shrt"}, "did you mean \"short\"?"},
      {{good, "--out", out(), "--variant", "orb"}, "no variant \"orb\""},
      {{good, "--out", out(), "--shard", "3/2"}, "out of range"},
      {{good, "--out", out(), "--shard", "0/2"}, "out of range"},
      {{good, "--out", out(), "--jobs", "0"}, "jobs"},
      {{good, "--out", out(), "--seeds", "0"}, "--seeds"},
      {{good, "--out", out(), "--max-frames", "0"}, "--max-frames"},
      {{good, "--out", out(), "--program", "/nowhere/dkb-slam"}, "/nowhere/dkb-slam"},
      {{good, "--merge", out()}, "either"},
      {{"--merge", out(), "--seeds", "3"}, "--seeds"},
      {{"--merge", out(), "--shard", "1/2"}, "--shard"},
      {{"--merge", out("empty")}, "suite.json"},
      {{"--merge", out("nowhere")}, "suite.json"},
  };
  for (const auto& [arguments, says] : cases) {
    const Finished run = bench(arguments);
    EXPECT_EQ(run.exit_code, 2) << says;
    EXPECT_EQ(run.error_lines(), 1u) << run.err;
    EXPECT_NE(run.err.find(says), std::string::npos) << "must hold `" << says << "`: " << run.err;
  }
  EXPECT_EQ(read_text(temp_.path() / "out" / "results.json"), kept);
}

TEST_F(Bench, AFullDiskEndsItWithEarlierResultsKept) {
  const fs::path file = suite(suite_text());
  ASSERT_EQ(bench({file.string(), "--out", out(), "--variant", "ORB"}).exit_code, 0);
  const std::string kept = read_text(temp_.path() / "out" / "results.json");
  const Finished full = bench({file.string(), "--out", out()}, 4000);
  EXPECT_EQ(full.exit_code, 1);
  EXPECT_EQ(full.error_lines(), 1u) << full.err;
  EXPECT_NE(full.err.find("cannot be written"), std::string::npos) << full.err;
  EXPECT_EQ(records(temp_ / "out"), 2u);
  EXPECT_EQ(read_text(temp_.path() / "out" / "results.json"), kept);
  EXPECT_FALSE(fs::exists(temp_.path() / "out" / "work"));
  const Finished rest = bench({file.string(), "--out", out()});
  EXPECT_NE(rest.out.find("2 runs done, 0 of them failed; 2 were there already"), std::string::npos) << rest.out;
}

}  // namespace
}  // namespace dkb::test
