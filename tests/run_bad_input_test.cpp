// SPDX-License-Identifier: Apache-2.0
// Bad input gives one clear line that names the place, exit code 2, and leaves nothing half-written.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <functional>
#include <sstream>

#include "dkb/dataset/image_codecs.h"
#include "e2e_support.h"

namespace dkb::test {
namespace {

namespace fs = std::filesystem;

struct Case {
  std::string name;
  std::string says;                            // what the message must hold
  std::function<void(const fs::path&)> spoil;  // given the dataset's folder
  std::vector<std::string> arguments = {};     // `@` stands for the folder
};

// Replaces row `row` of a list (comments not counted) by what `change` makes of it.
void change_row(const fs::path& list, size_t row, const std::function<std::string(const std::string&)>& change) {
  std::istringstream in(read_text(list));
  std::string text;
  size_t at = 0;
  for (std::string line; std::getline(in, line);) text += (line[0] != '#' && at++ == row ? change(line) : line) + "\n";
  write_text(list, text);
}
void change_all(const fs::path& list, const std::function<std::string(const std::string&)>& change) {
  const size_t rows = rows_of(list).size();
  for (size_t r = 0; r < rows; ++r) change_row(list, r, change);
}
std::string without_stamp(const std::string& row) {
  return row.substr(row.find(' '));
}
void use_lists(const fs::path& folder) {
  fs::remove(folder / "associations.txt");
}
void replace(const fs::path& file, const std::string& what, const std::string& by) {
  std::string text = read_text(file);
  const size_t at = text.find(what);
  if (at == std::string::npos) throw std::logic_error(file.string() + " holds no " + what);
  write_text(file, text.replace(at, what.size(), by));
}
void for_each_image(const fs::path& folder, size_t column, const std::function<void(const fs::path&)>& action) {
  for (const auto& row : rows_of(folder / "associations.txt")) action(folder / row[column]);
}

std::vector<Case> cases() {
  return {
      {"empty folder", "", [](const fs::path& d) { fs::remove_all(d), fs::create_directory(d); }},
      {"no such folder", "gone", [](const fs::path& d) { fs::rename(d, d.parent_path() / "elsewhere"); }},
      {"no rgb.txt", "rgb.txt", [](const fs::path& d) { use_lists(d), fs::remove(d / "rgb.txt"); }},
      {"no depth.txt", "depth.txt", [](const fs::path& d) { use_lists(d), fs::remove(d / "depth.txt"); }},
      {"empty list", "associations.txt", [](const fs::path& d) { write_text(d / "associations.txt", "# nothing\n"); }},
      {"malformed stamp", "rgb.txt:4",
       [](const fs::path& d) {
         use_lists(d), change_row(d / "rgb.txt", 2, [](const std::string& r) { return "x" + r; });
       }},
      {"NaN stamp", "associations.txt:2",
       [](const fs::path& d) {
         change_row(d / "associations.txt", 0, [](const std::string& r) { return "nan" + without_stamp(r); });
       }},
      {"stamps out of order", "rgb.txt:5",
       [](const fs::path& d) {
         use_lists(d), change_row(d / "rgb.txt", 3, [](const std::string& r) { return "1" + without_stamp(r); });
       }},
      {"repeated stamp", "associations.txt:7",
       [](const fs::path& d) {
         const std::string before = rows_of(d / "associations.txt")[4][0];
         change_row(d / "associations.txt", 5, [&](const std::string& r) { return before + without_stamp(r); });
       }},
      {"too few columns", "associations.txt:4",
       [](const fs::path& d) {
         change_row(d / "associations.txt", 2, [](const std::string& r) { return r.substr(0, r.find(' ')); });
       }},
      {"colour and depth of different days", "",
       [](const fs::path& d) {
         use_lists(d), change_all(d / "depth.txt", [](const std::string& r) { return "9" + r; });
       }},
      {"all images missing", "rgb/",
       [](const fs::path& d) { for_each_image(d, 1, [](const fs::path& f) { fs::remove(f); }); }},
      {"all images truncated", "",
       [](const fs::path& d) {
         for_each_image(d, 1, [](const fs::path& f) { write_text(f, read_text(f).substr(0, 100)); });
       }},
      {"images of another kind", "",
       [](const fs::path& d) { for_each_image(d, 1, [](const fs::path& f) { write_text(f, "GIF89a!"); }); }},
      {"colour of another size", "320",
       [](const fs::path& d) {
         for_each_image(d, 1, [](const fs::path& f) { write_text(f, encode_jpeg(ColourImage(320, 240))); });
       }},
      {"depth of another size", "320",
       [](const fs::path& d) {
         for_each_image(d, 3, [](const fs::path& f) { write_text(f, encode_png(Image<uint16_t>(320, 240, 5000))); });
       }},
      {"depth of 8 bits", "8-bit",
       [](const fs::path& d) {
         for_each_image(d, 3, [](const fs::path& f) { write_text(f, encode_png(GreyImage(640, 480, 50))); });
       }},
      {"misspelt camera key", "depth_factor",
       [](const fs::path& d) { replace(d / "camera.yaml", "depth_factor", "depth_factr"); }},
      {"negative focal length", "fx", [](const fs::path& d) { replace(d / "camera.yaml", "fx: ", "fx: -"); }},
      {"missing camera key", "cx", [](const fs::path& d) { replace(d / "camera.yaml", "cx:", "# cx:"); }},
      {"camera file that is no YAML", "camera.yaml", [](const fs::path& d) { write_text(d / "camera.yaml", "{{{"); }},
      {"missing camera file", "none.yaml", [](const fs::path&) {}, {"--camera", "@/none.yaml"}},
      {"unknown option", "detectr", [](const fs::path&) {}, {"--detectr", "none"}},
      {"unknown setting", "features.count", [](const fs::path&) {}, {"--set", "featurs.count=5"}},
      {"setting of another type", "features.count", [](const fs::path&) {}, {"--set", "features.count=many"}},
      {"setting out of range",
       "pipeline.mapper_latency: 0 is out of range",
       [](const fs::path&) {},
       {"--set", "pipeline.mapper_latency=0"}},
      {"unknown preset", "papre", [](const fs::path&) {}, {"--preset", "papre"}},
      {"unknown detector", "yolos", [](const fs::path&) {}, {"--detector", "yolos"}},
      {"unknown inference", "onnxruntme", [](const fs::path&) {}, {"--inference", "onnxruntme"}},
      {"inference without a network",
       "--inference",
       [](const fs::path&) {},
       {"--detector", "motion", "--inference", "opencv"}},
      {"final adjustment of a map that stays",
       "--final-ba",
       [](const fs::path&) {},
       {"--localize", "--load-map", "@/map.dkb", "--final-ba"}},
      {"topic beside a file of motions",
       "--odom-topic",
       [](const fs::path&) {},
       {"--prior-file", "@/wheels.txt", "--odom-topic", "/odom"}},
      {"topic of an inertial unit beside a file of motions",
       "--imu-topic",
       [](const fs::path&) {},
       {"--prior-file", "@/wheels.txt", "--imu-topic", "/imu"}},
      {"topic that nothing reads",
       "--odom-topic",
       [](const fs::path&) {},
       {"--prior", "none", "--odom-topic", "/odom"}},
      {"number too large", "--max-frames", [](const fs::path&) {}, {"--max-frames", "99999999999999999999"}},
      {"number of another base", "--max-frames", [](const fs::path&) {}, {"--max-frames", "0x10"}},
      {"missing boxes file", "none.txt", [](const fs::path&) {}, {"--detector", "file", "--boxes", "@/none.txt"}},
      {"boxes that no detector reads",
       "--boxes",
       [](const fs::path&) {},
       {"--detector", "motion", "--boxes", "@/none.txt"}},
      {"NaN box",
       "b.txt:2",
       [](const fs::path& d) { write_text(d / "b.txt", "# t class x y w h\n1700000000.0 person nan 3 4 5\n"); },
       {"--detector", "file", "--boxes", "@/b.txt"}},
      {"settings of a file that contradict each other",
       "c.yaml:3: features.fast_threshold",
       [](const fs::path& d) { write_text(d / "c.yaml", "# mine\nfeatures:\n  fast_threshold: 5\n"); },
       {"--config", "@/c.yaml"}},
      {"settings that contradict each other",
       "--set: dense.obstacle_high",
       [](const fs::path&) {},
       {"--set", "dense.obstacle_high=0.05"}},
      {"presets that contradict each other",
       "--preset paper",
       [](const fs::path& d) { write_text(d / "c.yaml", "preset: default\n"); },
       {"--preset", "paper", "--config", "@/c.yaml"}},
      {"results into the source", "--out", [](const fs::path&) {}, {"--out", "@/."}},
      {"a value too many", "unexpected argument \"c=d\"", [](const fs::path&) {}, {"--set", "seed=2", "c=d"}},
      {"boxes of another recording",
       "none of its boxes",
       [](const fs::path& d) { write_text(d / "b.txt", "1.0 person 2 3 40 50\n"); },
       {"--detector", "file", "--boxes", "@/b.txt"}},
      {"odometry of another recording",
       "o.txt: its times, 1.000 ... 2.000 s",
       [](const fs::path& d) { write_text(d / "o.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n"); },
       {"--prior-file", "@/o.txt"}},
      {"two priors",
       "--prior odom",
       [](const fs::path& d) { write_text(d / "o.txt", "1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n"); },
       {"--prior", "odom", "--prior-file", "@/o.txt"}},
      {"classes of no network", "--labels", [](const fs::path&) {}, {"--detector", "motion", "--labels", "x"}},
      {"what may move of no network", "--classes", [](const fs::path&) {}, {"--detector", "motion", "--classes", "x"}},
      {"a model of no network", "--model", [](const fs::path&) {}, {"--detector", "motion", "--model", "x"}},
      {"detections of no network",
       "--detect-every",
       [](const fs::path&) {},
       {"--detector", "motion", "--detect-every", "2"}},
      {"no frames between detections", "--detect-every", [](const fs::path&) {}, {"--detect-every", "0"}},
      {"detections before their frame", "--detect-latency", [](const fs::path&) {}, {"--detect-latency", "-1"}},
      {"negative seed", "--seed", [](const fs::path&) {}, {"--seed", "-1"}},
      {"negative threads", "--threads", [](const fs::path&) {}, {"--threads", "-1"}},
      {"too many features", "features.count: 100001", [](const fs::path&) {}, {"--set", "features.count=100001"}},
      {"mapping too late",
       "pipeline.mapper_latency: 11",
       [](const fs::path&) {},
       {"--set", "pipeline.mapper_latency=11"}},
      {"auto among others", "auto cannot be joined", [](const fs::path&) {}, {"--detector", "auto+motion"}},
      {"none among others", "none cannot be joined", [](const fs::path&) {}, {"--detector", "none+motion"}},
      {"the same detector twice", "motion twice", [](const fs::path&) {}, {"--detector", "motion+motion"}},
      {"address of no page", "--viewer-host", [](const fs::path&) {}, {"--viewer-host", "127.0.0.1"}},
      {"end of no page", "--viewer-exit", [](const fs::path&) {}, {"--viewer-exit"}},
      {"frames that are none", "max", [](const fs::path&) {}, {"--max-frames", "0"}},
      {"nothing left to run", "", [](const fs::path&) {}, {"--start", "1000"}},
  };
}

TEST(RunBadInput, IsRefusedInOneClearLine) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const TempFolder temp;
    const fs::path folder = temp / (c.name == "no such folder" ? "gone" : "data");
    copy_sequence(folder, 8, true);
    c.spoil(folder);
    std::vector<std::string> arguments = {"run", folder.string(), "--quiet"};
    if (std::find(c.arguments.begin(), c.arguments.end(), "--out") == c.arguments.end())
      arguments.insert(arguments.end(), {"--out", (temp / "out").string()});
    bool detector = false;
    for (std::string a : c.arguments) {
      if (const size_t at = a.find('@'); at != std::string::npos) a.replace(at, 1, folder.string());
      detector = detector || a == "--detector" || a == "--detectr";
      arguments.push_back(a);
    }
    if (!detector) arguments.insert(arguments.end(), {"--detector", "none"});
    const Finished run = run_program(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_EQ(run.error_lines(), 1U) << run.err;
    EXPECT_NE(run.err.find("error: "), std::string::npos) << run.err;
    EXPECT_NE(run.err.find(c.says), std::string::npos) << "it must hold \"" << c.says << "\": " << run.err;
    EXPECT_FALSE(fs::exists(temp.path() / "out" / "trajectory.txt"));
  }
}

TEST(RunBadInput, TheSameFolderUnspoiltRuns) {
  const TempFolder temp;
  copy_sequence(temp / "data", 8, true);
  const Finished run =
      run_program({"run", (temp / "data").string(), "--out", (temp / "out").string(), "--detector", "none", "--quiet"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  use_lists(temp / "data");
  const Finished by_lists = run_program(
      {"run", (temp / "data").string(), "--out", (temp / "out2").string(), "--detector", "none", "--quiet"});
  EXPECT_EQ(by_lists.exit_code, 0) << by_lists.err;
  EXPECT_EQ(read_text(temp.path() / "out" / "trajectory.txt"), read_text(temp.path() / "out2" / "trajectory.txt"));
}

TEST(RunBadInput, AnOutputThatCannotBeMadeIsRefusedBeforeTheRun) {
  const TempFolder temp;
  write_text(temp / "file", "mine");
  for (const std::string& out :
       {std::string("/proc/nowhere/out"), (temp / "file").string(), (temp / "file").string() + "/out"}) {
    SCOPED_TRACE(out);
    const Finished run = run_program({"run", sequence().string(), "--out", out, "--detector", "none", "--quiet"});
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_EQ(run.error_lines(), 1U) << run.err;
    EXPECT_NE(run.err.find(out.substr(0, out.rfind('/'))), std::string::npos) << run.err;
  }
  EXPECT_EQ(read_text(temp / "file"), "mine");
}

TEST(RunBadInput, AFullDiskLeavesNothingHalfWritten) {
  const TempFolder temp;
  const Finished run = run_program({"run", sequence().string(), "--out", (temp / "out").string(), "--detector", "none",
                                    "--max-frames", "20", "--quiet"},
                                   1000);
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_EQ(run.error_lines(), 1U) << run.err;
  EXPECT_NE(run.err.find("trajectory.txt"), std::string::npos) << run.err;
  EXPECT_FALSE(fs::exists(temp / "out")) << "nothing came into it";
}

TEST(RunBadInput, AnEarlierResultSurvivesAFullDisk) {
  const TempFolder temp;
  fs::create_directory(temp / "out");
  write_text(temp.path() / "out" / "trajectory.txt", "earlier");
  const Finished run = run_program({"run", sequence().string(), "--out", (temp / "out").string(), "--detector", "none",
                                    "--max-frames", "20", "--quiet"},
                                   1000);
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_EQ(read_text(temp.path() / "out" / "trajectory.txt"), "earlier");
}

TEST(RunBadInput, NoCommandNoDatasetAndAMisspeltCommandAreRefused) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{}, {"run"}, {"rnu"}, {"run", "--out"}}) {
    const Finished run = run_program(arguments);
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_EQ(run.error_lines(), 1U) << run.err;
  }
}

TEST(RunBadInput, UsageIsToldInPlainWords) {
  const std::string folder = sequence().string();
  const std::pair<std::vector<std::string>, std::string> cases[] = {
      {{"simulate", "--out", "x", "--size", "640"}, "--size: one value is given; give 2; see dkb-slam simulate --help"},
      {{"compare", "--help"}, "unknown command \"compare\"; commands: run, live, "},
      {{"map", "infos", "--help"}, "unknown command \"infos\" (did you mean \"info\"?); see dkb-slam map --help"},
      {{"rum", "--help"}, "unknown command \"rum\" (did you mean \"run\"?); see dkb-slam --help"},
      {{"run", folder, "--detector", "foo"}, "--detector: there is no detector \"foo\"; detectors: auto, none, "},
      {{"run", folder, "--disable", "foo"}, "--disable: there is no part \"foo\"; parts: dr, kf, ba, loop"},
      {{"run", folder, "--classes", "person"},
       "--classes: --detector auto has no network; leave it out, or name a network with --model\n"},
      {{"run", folder, "--out"}, "--out: its value is missing; see dkb-slam run --help"},
      {{"run", folder, "--camera", "fr1", "--camera", "fr2"}, "--camera: is given 2 times; give it once; see"},
      {{"map", "export", "m.dkb", "--format", "pyl", "--out", "x"},
       "--format: there is no \"pyl\" (did you mean \"ply\"?); give one of ply, pcd, json, colmap, nerfstudio; see"}};
  for (const auto& [arguments, says] : cases) {
    const Finished run = run_program(arguments);
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_EQ(run.err.find("error: " + says), 0U) << run.err;
    EXPECT_EQ(run.error_lines(), 1U) << run.err;
  }
  EXPECT_NE(run_program({"simulate", "--help"}).out.find("--size INTxINT"), std::string::npos);
  EXPECT_NE(run_program({"view", "--help"}).out.find(" session [session]"), std::string::npos);
}

TEST(RunBadInput, OptionsThatDoNothingInAConversionAreRefused) {
  const TempFolder temp;
  const std::string folder = sequence().string(), bag = (temp / "a.bag").string(), out = (temp / "out").string();
  copy_sequence(temp / "data", 5, false);
  ASSERT_EQ(
      run_program({"convert", (temp / "data").string(), "--out", bag, "--compression", "none", "--raw"}).exit_code, 0);
  const std::vector<std::vector<std::string>> cases = {
      {folder, out, "--compression", "none"},        {folder, out, "--colour-topic", "/a"},
      {folder, out + ".bag", "--depth-topic", "/a"}, {bag, out, "--raw"},
      {bag, out, "--compression", "none"},           {bag, out + ".mcap", "--raw"},
      {bag, out + ".mcap", "--info-topic", "/a"}};
  for (const auto& c : cases) {
    std::vector<std::string> arguments = {"convert", c[0], "--out", c[1]};
    arguments.insert(arguments.end(), c.begin() + 2, c.end());
    const Finished run = run_program(arguments);
    EXPECT_EQ(run.exit_code, 2) << c[2];
    EXPECT_EQ(run.error_lines(), 1U) << run.err;
    EXPECT_NE(run.err.find(c[2] + ": does nothing"), std::string::npos) << run.err;
  }
}

TEST(RunBadInput, NegativeNumbersOfTheSimulatorAreRefused) {
  const TempFolder temp;
  for (const char* option : {"--people", "--seed"}) {
    const Finished run = run_program({"simulate", "--out", (temp / "made").string(), option, "-1"});
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_NE(run.err.find(option), std::string::npos) << run.err;
    EXPECT_FALSE(fs::exists(temp / "made"));
  }
}

TEST(RunBadInput, WholeNumbersAreDecimal) {
  const TempFolder temp;
  const auto simulate = [&](const std::string& frames) {
    return run_program({"simulate", "--out", (temp / "made").string(), "--size", "64x64", "--frames", frames});
  };
  const Finished run = simulate("010");
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(rows_of(temp.path() / "made" / "rgb.txt").size(), 10U);
  const Finished refused = simulate("99999999999");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("--frames: \"99999999999\" is not a whole number of "), std::string::npos) << refused.err;
}

TEST(RunBadInput, AnOutputFileWithoutItsFolderIsRefusedWithTheRemedy) {
  const TempFolder temp;
  fs::create_directory(temp / "folder");
  const std::string truth = (sequence() / "groundtruth.txt").string(), none = (temp / "none/a").string();
  SlamRun run(sequence(), temp / "run", {"--max-frames", "12"});
  const std::string map = (run.out / "map.dkb").string();
  const std::vector<std::vector<std::string>> cases = {{"eval", truth, truth, "--json"},
                                                       {"export", truth, "--format", "tum", "--out"},
                                                       {"map", "merge", map, map, "--out"}};
  for (const auto& c : cases)
    for (const auto& [out, remedy] : {std::pair(none, "make the folder, or choose another"),
                                      std::pair((temp / "folder").string(), "choose another place")}) {
      std::vector<std::string> arguments = c;
      arguments.push_back(out);
      const Finished done = run_program(arguments);
      EXPECT_EQ(done.exit_code, 2) << c[0];
      EXPECT_EQ(done.error_lines(), 1U) << done.err;
      EXPECT_NE(done.err.find(remedy), std::string::npos) << done.err;
    }
}

}  // namespace
}  // namespace dkb::test
