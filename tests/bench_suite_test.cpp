// SPDX-License-Identifier: Apache-2.0
// Suites as text: what they mean, and that whatever is wrong with one is said in one line.
#include "bench/bench_suite.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <set>

#include "bench/bench_report.h"
#include "dkb/dataset/mutation_test_tools.h"
#include "dkb/util/errors.h"
#include "dkb/util/files.h"

namespace dkb::bench {
namespace {

namespace fs = std::filesystem;

const char* const kSuite = R"(name: small
description: for tests
root: ${DKB_BENCH_TEST_DATA}
seeds: 3
max_frames: 50
timeout: 60
reference: ORB
plotted: [ORB, w=1.5]
published: published.yaml
sequences:
  fr1_xyz: {path: rgbd_dataset_freiburg1_xyz, camera: fr1, get: somewhere, published: fr1/xyz, max_frames: 20}
  room:
    simulate: {scene: room, people: 0, seed: 4, frames: 30}
variants:
  ORB: {preset: orb, published: ORB-SLAM3}
  mine:
    detector: yolo+motion
    model: ${MODEL}
    filter: box
    disable: [kf, ba]
    set: {features.count: 900, experiment.mapping.ba.edge_weight: 1.7}
  default:
sweep:
  setting: experiment.mapping.ba.edge_weight
  label: w
  values: [1.0, 1.5]
  published_choice: 1.5
  options: {preset: paper, detector: none}
)";
const char* const kPublished = R"(source: a paper
ape_m:
  fr1/xyz: {ORB-SLAM3: 0.0100, DS-SLAM: 0.02}
sweep_m:
  fr1/xyz: {1.5: 0.009}
)";

Suite parse(const std::string& text) {
  return parse_suite({"suites/small.yaml", text, kPublished, 0, 0});
}
std::string message_of(const std::string& text) {
  try {
    parse(text);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}
std::string replaced(std::string text, const std::string& what, const std::string& by) {
  const size_t at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), by);
}

TEST(BenchSuite, SaysWhatToRun) {
  const Suite s = parse(kSuite);
  EXPECT_EQ(s.name, "small");
  EXPECT_EQ(s.seeds, 3);
  ASSERT_EQ(s.sequences.size(), 2u);
  EXPECT_EQ(s.sequences[0].path, "rgbd_dataset_freiburg1_xyz");
  EXPECT_EQ(s.sequences[0].max_frames, 20);
  ASSERT_TRUE(s.sequences[1].simulated);
  EXPECT_EQ(s.sequences[1].simulated->people, 0);
  EXPECT_EQ(s.sequences[1].simulated->frames, 30);
  ASSERT_EQ(s.variants.size(), 5u);
  const SuiteVariant& mine = *s.variant("mine");
  EXPECT_EQ(mine.disable, (std::vector<std::string>{"kf", "ba"}));
  EXPECT_EQ(mine.set.at("features.count"), "900");
  EXPECT_EQ(s.variants[4].name, "w=1.5");
  EXPECT_EQ(s.variants[4].set.at("experiment.mapping.ba.edge_weight"), "1.5");
  EXPECT_EQ(s.variants[4].preset, "paper");
  EXPECT_EQ(s.variants[4].swept, 1.5);
}

TEST(BenchSuite, FindsPublishedNumbersByTheirNames) {
  const Suite s = parse(kSuite);
  EXPECT_EQ(s.published_ape(s.sequences[0], *s.variant("ORB")), 0.01);
  EXPECT_EQ(s.published_ape(s.sequences[0], *s.variant("w=1.5")), 0.009);
  EXPECT_FALSE(s.published_ape(s.sequences[0], *s.variant("w=1.0")));
  EXPECT_FALSE(s.published_ape(s.sequences[1], *s.variant("ORB")));
}

TEST(BenchSuite, TheNameIsTheFilesWithoutOne) {
  EXPECT_EQ(parse("sequences: {a: {path: b}}\nvariants: {v: }\n").name, "small");
  EXPECT_EQ(parse("sequences: {a: {path: b}}\nvariants: {v: }\n").seeds, 5);
}

TEST(BenchSuite, FaultsAreOneLineWithThePlace) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {replaced(kSuite, "seeds:", "sedes:"),
       "small.yaml:4: unknown key \"sedes\" (did you mean \"seeds\"?); the keys are name, "},
      {replaced(kSuite, "camera:", "camra:"),
       "small.yaml:11: unknown key \"sequences.fr1_xyz.camra\" (did you mean \"camera\"?)"},
      {replaced(kSuite, "preset: orb", "preset: orbs"), "there is no preset \"orbs\" (did you mean \"orb\"?)"},
      {replaced(kSuite, "features.count", "features.cuont"), "(did you mean \"features.count\"?)"},
      {replaced(kSuite, "900", "-900"), "count: -900 is out of range"},
      {replaced(kSuite, "filter: box", "filter: bax"), "dynamics.filter"},
      {replaced(kSuite, "yolo+motion", "yolo+motoin"), "(did you mean \"motion\"?)"},
      {replaced(kSuite, "detector: yolo+motion", "detector: motion"), "--model: --detector motion has no network"},
      {replaced(kSuite, "    model: ${MODEL}\n", ""), "--detector yolo: no model"},
      {replaced(kSuite, "filter: box", "boxes: b.txt"), "--boxes: --detector yolo+motion does not read boxes"},
      {replaced(kSuite, "paper, detector: none", "paper, detector: file"), "--detector file: no boxes"},
      {replaced(kSuite, "[kf, ba]", "[kf, bs]"), "there is no part \"bs\""},
      {replaced(kSuite, "reference: ORB", "reference: ORBS"),
       "small.yaml:7: reference: there is no variant \"ORBS\" (did you mean \"ORB\"?)"},
      {replaced(kSuite, "plotted: [ORB,", "plotted: [OR,"), "small.yaml:8: plotted: there is no variant \"OR\""},
      {replaced(kSuite, "scene: room", "scene: rom"),
       "small.yaml:13: sequences.room.simulate.scene: \"rom\" is not one of room, "},
      {replaced(kSuite, "scene: room", "scene: rom"), "(did you mean \"room\"?)"},
      {replaced(kSuite, "seeds: 3", "seeds: 0"), "small.yaml:4: seeds: 0 is out of range; it must be 1 ... 1000"},
      {replaced(kSuite, "seeds: 3", "seeds: 3\nseeds: 4"), "small.yaml:5: seeds: is given twice; leave one out"},
      {replaced(kSuite, "path: rgbd", "pth: rgbd"), "unknown key \"sequences.fr1_xyz.pth\" (did you mean \"path\"?)"},
      {replaced(kSuite, "  room:", "  ../room:"), "must be made of letters"},
      {replaced(kSuite, "values: [1.0, 1.5]", "values: [1.0]"), "at least two values"},
      {replaced(kSuite, "experiment.mapping.ba.edge_weight\n  label", "experiment.mapping.ba.edge_wight\n  label"),
       "edge_weight"},
      {"sequences: {a: {path: b}}\n", "has no variants"},
      {"variants: {a: }\n", "has no sequences"},
      {"{{{", "is not valid YAML"},
      {"", "small.yaml:1: must be lines of the form `key: value`; the keys are name, "},
      {"- a\n", "small.yaml:1: must be lines of"},
  };
  for (const auto& [text, says] : cases) {
    const std::string message = message_of(text);
    EXPECT_NE(message.find(says), std::string::npos) << "must hold `" << says << "`: " << message;
    EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    EXPECT_EQ(message.rfind("suites/small.yaml", 0), 0u) << message;
  }
}

TEST(BenchSuite, MutatedTextIsReadOrRefusedInOneLine) {
  Random random(5);
  int refused = 0;
  for (int i = 0; i < 4000; ++i) {
    const std::string text = mutated(kSuite, random);
    try {
      const Suite s = parse(text);
      EXPECT_FALSE(s.sequences.empty());
      suite_hash(s);
    } catch (const InputError& e) {
      ++refused;
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(BenchSuite, MutatedPublishedNumbersAreReadOrRefused) {
  Random random(6);
  for (int i = 0; i < 2000; ++i) try {
      parse_published(mutated(kPublished, random), "published.yaml");
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos) << e.what();
    }
}

TEST(BenchSuite, PartsToSwitchOffMayBeOneTextWithBlanks) {
  const Suite suite = parse("sequences: {a: {path: b}}\nvariants: {v: {disable: \"kf, ba\"}}\n");
  EXPECT_EQ(suite.variants.at(0).disabled(), "kf, ba");
}

TEST(BenchSuite, TheHashIsOfWhatIsMeasured) {
  const std::string hash = suite_hash(parse(kSuite));
  EXPECT_EQ(hash.size(), 16u);
  EXPECT_EQ(hash, suite_hash(parse("# a remark\n" + replaced(kSuite, "for tests", "still for tests"))));
  EXPECT_NE(hash, suite_hash(parse(replaced(kSuite, "900", "901"))));
  EXPECT_NE(hash, suite_hash(parse(replaced(kSuite, "seeds: 3", "seeds: 4"))));
  EXPECT_NE(hash, suite_hash(parse(replaced(kSuite, "seed: 4", "seed: 5"))));
}

TEST(BenchSuite, TheCommandLineOverridesSeedsAndFrames) {
  const Suite s = parse_suite({"small.yaml", kSuite, kPublished, 7, 10});
  EXPECT_EQ(s.seeds, 7);
  EXPECT_EQ(s.max_frames, 10);
  EXPECT_EQ(s.sequences[0].max_frames, 0);
}

TEST(BenchSuite, ShardsAreADivisionOfAllRuns) {
  const Suite s = parse(kSuite);
  std::set<std::tuple<size_t, size_t, int>> seen;
  size_t count = 0;
  for (int i = 1; i <= 4; ++i)
    for (const Job& job : jobs_of(s, Shard{i, 4})) seen.insert({job.sequence, job.variant, job.seed}), ++count;
  EXPECT_EQ(count, 2u * 5u * 3u);
  EXPECT_EQ(seen.size(), count);
  EXPECT_TRUE(jobs_of(s, Shard{100, 100}).empty()) << "more shards than runs";
}

TEST(BenchSuite, ShardsOutOfRangeAreRefused) {
  EXPECT_EQ(parse_shard("2/8").index, 2);
  EXPECT_EQ(parse_shard("8/8").count, 8);
  for (const char* text : {"0/8", "9/8", "1/0", "-1/8", "1/100001", "99999999999999999999/1"})
    EXPECT_THROW(parse_shard(text), InputError) << text;
  for (const char* text : {"", "3", "a/b", "1/2/3", "1 / 2", "/"}) EXPECT_THROW(parse_shard(text), InputError) << text;
}

TEST(BenchSuite, VariablesOfTheEnvironmentAreReplaced) {
  setenv("DKB_BENCH_TEST_A", "x", 1);
  unsetenv("DKB_BENCH_TEST_B");
  std::string missing;
  EXPECT_EQ(expand_environment("${DKB_BENCH_TEST_A}/b/${DKB_BENCH_TEST_A}", &missing), "x/b/x");
  EXPECT_EQ(expand_environment("$a${", &missing), "$a${");
  EXPECT_FALSE(expand_environment("a/${DKB_BENCH_TEST_B}", &missing));
  EXPECT_EQ(missing, "DKB_BENCH_TEST_B");
}

TEST(BenchSuite, TheProjectsSuitesAreSound) {
  int seen = 0;
  for (const auto& entry : fs::directory_iterator(fs::path(DKB_SOURCE_DIR) / "bench" / "suites")) {
    if (entry.path().filename() == "published.yaml") continue;
    ++seen;
    const Suite s = parse_suite(read_suite(entry.path()));
    EXPECT_EQ(s.name, entry.path().stem());
    EXPECT_GE(s.seeds, 5) << s.name << ": an interval needs five runs";
    for (const SuiteSequence& sequence : s.sequences)
      EXPECT_TRUE(sequence.simulated || !sequence.get.empty()) << sequence.name << ": say how to get it";
  }
  EXPECT_EQ(seen, 6);
}

// Two systems on two sequences, with known figures.
std::vector<RunRecord> records() {
  std::vector<RunRecord> all;
  for (const char* sequence : {"fr1_xyz", "room"})
    for (const char* variant : {"ORB", "default", "w=1.0", "w=1.5"})
      for (int seed = 1; seed <= 3; ++seed) {
        RunRecord r;
        r.sequence = sequence;
        r.variant = variant;
        r.seed = seed;
        r.frames = 20;
        r.tracked = 19;
        r.ape = Scores();
        r.ape->translation_m.rmse = (std::string(variant) == "ORB" ? 0.02 : 0.01) + 0.001 * seed;
        all.push_back(r);
      }
  all[4].failure = "crashed: signal 11 (Segmentation fault)";
  return all;
}

TEST(BenchReport, CountsFinishedFailedAndMissingRuns) {
  const Suite suite = parse(kSuite);
  const Results results = results_of(suite, records());
  ASSERT_EQ(results.cells.size(), 10u);
  EXPECT_EQ(results.cells[0].finished.size(), 3u);
  EXPECT_DOUBLE_EQ(median_of(results.cells[0].ape()), 0.022);
  EXPECT_EQ(results.cells[1].not_run, 3) << "`mine` was not run";
  EXPECT_EQ(results.cells[2].finished.size(), 2u);
  EXPECT_EQ(results.cells[2].failed.size(), 1u);
}

TEST(BenchReport, ComparesRunsOfTheSameSeedWithTheReference) {
  const Suite suite = parse(kSuite);
  const Results results = results_of(suite, records());
  ASSERT_EQ(results.comparisons.size(), 4u);
  EXPECT_EQ(results.comparisons[0].variant, "mine");
  EXPECT_EQ(results.comparisons[0].sequences, 0);
  EXPECT_EQ(results.comparisons[2].variant, "w=1.0");
  EXPECT_NEAR(results.comparisons[2].ratio.median, 0.012 / 0.022, 1e-12);
}

// A system that loses track after a fifth of the frames is scored on these alone.
TEST(BenchReport, MarksRatiosOfFramesThatTheOtherDidNotScore) {
  const Suite suite = parse(kSuite);
  std::vector<RunRecord> all = records();
  for (RunRecord& r : all) {
    r.ape->translation_m.count = r.sequence == "room" && r.variant == "w=1.0" ? 4 : 19;
    if (r.variant == "default" && r.seed == 1) r.ape->translation_m.count = 2;  // one run of two or three
  }
  const Results results = results_of(suite, all);
  EXPECT_DOUBLE_EQ(results.cells[0].scored(), 0.95);
  ASSERT_EQ(results.comparisons.size(), 4u);
  const Comparison& c = results.comparisons[2];
  ASSERT_EQ(c.uneven.size(), 1u);
  EXPECT_EQ(c.uneven[0].sequence, "room");
  EXPECT_DOUBLE_EQ(c.uneven[0].ours, 0.2);
  EXPECT_DOUBLE_EQ(c.uneven[0].reference, 0.95);
  EXPECT_TRUE(results.comparisons[3].uneven.empty());
}

TEST(BenchReport, SaysThatASweepWithoutEffectIsNoise) {
  const Suite suite = parse(kSuite);
  const Results results = results_of(suite, records());
  ASSERT_EQ(results.sweep.size(), 2u);
  EXPECT_EQ(results.sweep[0].p_value, 1);
  const auto sentences = sweep_sentences(results);
  ASSERT_EQ(sentences.size(), 3u);
  EXPECT_EQ(sentences[0].rfind("On no sequence do the differences exceed the noise", 0), 0u) << sentences[0];
}

TEST(BenchReport, RecordsSurviveWritingAndReading) {
  RunRecord r = records()[4];
  r.machine.cv_orb_ms = 4.5;
  r.online_m = ErrorStatistics();
  r.rpe = Scores();
  r.rpe->rotation_deg.rmse = 0.25;
  r.rpe->rotation_deg.count = 5;
  r.maps = 3;
  EXPECT_EQ(parse_record(record_json(r), "r").rpe->rotation_deg.rmse, 0.25);
  EXPECT_EQ(parse_record(record_json(r), "r").maps, 3);
  r.ape->rotation_deg = {};  // no rotation was determined
  const std::string text = record_json(r);
  EXPECT_NE(text.find("\"rotation_deg\": null"), std::string::npos) << text;
  EXPECT_EQ(parse_record(text, "r").ape->rotation_deg.count, 0u);
  EXPECT_EQ(record_json(parse_record(text, "r")), text);
  Random random(7);
  for (int i = 0; i < 2000; ++i) try {
      parse_record(mutated(text, random), "r.json");
    } catch (const InputError& e) {
      EXPECT_EQ(std::string(e.what()).rfind("r.json", 0), 0u) << e.what();
    }
}

}  // namespace
}  // namespace dkb::bench
