// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/options.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string refusal(const std::string& assignment) {
  Options options;
  return test::input_error_of([&] { options.assign(assignment, "--set"); });
}

struct YamlFile {
  explicit YamlFile(const std::string& text)
      : path(std::filesystem::temp_directory_path() / ("dkb_options_" + std::to_string(getpid()) + ".yaml")) {
    std::ofstream(path) << text;
  }
  ~YamlFile() { std::filesystem::remove(path); }
  std::filesystem::path path;
};

TEST(Options, TheirPageIsWhatTheProgramSays) {
  const std::string page = read_file(std::filesystem::path(DKB_SOURCE_DIR) / "docs" / "settings.md");
  EXPECT_NE(page.find(settings_table()), std::string::npos) << "docs/settings.md must hold this table:\n"
                                                            << settings_table();
}

TEST(Options, AreFortyAtMostAndALineEach) {
  EXPECT_LE(lines_of(settings_table()).size(), 40u + 2u);
  const std::vector<std::string> lines = lines_of(Options().to_yaml());
  EXPECT_EQ(lines.front().rfind("preset: default", 0), 0u);
  const auto is_setting = [](const std::string& line) { return line.find(": ") != std::string::npos; };
  EXPECT_LE(std::count_if(lines.begin(), lines.end(), is_setting), 40);
  for (const std::string& line : lines)
    if (is_setting(line) && &line != &lines.front()) {
      EXPECT_NE(line.find("default "), std::string::npos) << line;
    }
}

TEST(Options, TheirListSaysWhatMayBeSet) {
  Options options;
  options.set("features.count", "950");
  const std::vector<Setting> all = options.settings();
  const auto found = [&](const std::string& key) {
    return *std::find_if(all.begin(), all.end(), [&](const Setting& s) { return s.key == key; });
  };
  EXPECT_EQ(all.size() + 2, lines_of(settings_table()).size());
  const Setting count = found("features.count"), scale = found("features.scale"), filter = found("dynamics.filter");
  EXPECT_EQ(count.value, "950");
  EXPECT_EQ(count.initial, "900");
  EXPECT_EQ(count.meaning, "[features] wanted per image");
  EXPECT_EQ(count.kind, SettingKind::whole);
  EXPECT_EQ(count.min, 1);
  EXPECT_EQ(count.max, 8000);
  EXPECT_EQ(scale.kind, SettingKind::number);
  EXPECT_TRUE(scale.above_min);
  EXPECT_EQ(filter.kind, SettingKind::name);
  EXPECT_EQ(filter.choices, (std::vector<std::string>{"none", "box", "epipolar", "multiview", "paper", "default"}));
  EXPECT_EQ(found("loop.enabled").kind, SettingKind::boolean);
  for (const Setting& s : all) EXPECT_NO_THROW(options.set(s.key, s.initial)) << s.key;
  EXPECT_EQ(options.to_yaml(), Options().to_yaml());
}

TEST(Options, DefaultsOfTheHeaderAreThoseOfTheStages) {
  Options header;
  header.seed = 1;
  header.features = {};
  header.noise = {};
  header.tracking = {};
  header.keyframes = {};
  header.mapping = {};
  header.loop = {};
  header.global_ba = {};
  header.timing = {};
  header.dynamics = {};
  header.dense = {};
  header.pipeline = {};
  EXPECT_EQ(header.to_yaml(), Options().to_yaml());
  EXPECT_NO_THROW(header.check());
}

TEST(Options, ReachTheStages) {
  Options options;
  options.assign("features.count=777");
  options.tracking.close_depth = 2.5;
  options.assign("mapping.ba.weighted=false");
  options.pipeline.mapper_latency = 0.1;
  options.assign("experiment.mapping.ba.edge_weight=1.7");
  options.realtime = true;
  const SlamOptions stages = expand(options);
  EXPECT_EQ(stages.features.count, 777);
  EXPECT_EQ(stages.tracking.close_depth, 2.5);
  EXPECT_FALSE(stages.mapping.ba.weighted);
  EXPECT_EQ(stages.pipeline.mapper_latency, 0.1);
  EXPECT_EQ(stages.mapping.ba.weights.edge_weight, 1.7);
  EXPECT_TRUE(stages.pipeline.realtime);
}

TEST(Options, SurviveTheirYaml) {
  Options written("paper");
  written.seed = 7;
  written.features.scale = 1.0 / 3.0 + 1;
  written.dynamics.filter = FilterKind::standard;
  written.loop.enabled = false;
  written.set("experiment.keyframes.normals", "oriented");
  const YamlFile file(written.to_yaml());
  Options read("orb");
  read.set("experiment.mapping.ba.edge_weight", "1.2");
  read.load(file.path);
  EXPECT_EQ(read.preset(), "paper");
  EXPECT_EQ(read.to_yaml(), written.to_yaml());
  EXPECT_EQ(expand(read).adaptive_keyframes.normals, NormalSum::oriented);
}

TEST(Options, AYamlsPresetComesFirstWhereverItStands) {
  const YamlFile file("features: {count: 500}\npreset: orb\n");
  Options options;
  options.load(file.path);
  EXPECT_EQ(options.features.count, 500);
  EXPECT_EQ(options.dynamics.filter, FilterKind::none);
}

TEST(Options, ExperimentsAreWrittenOnlyWhenSet) {
  Options options("paper");
  EXPECT_EQ(options.to_yaml().find("experiment"), std::string::npos);
  options.set("experiment.mapping.ba.edge_weight", "1.7");
  EXPECT_NE(options.to_yaml().find("experiment:\n  mapping:\n    ba:\n      edge_weight: 1.7"), std::string::npos);
}

TEST(Options, ErrorsNameTheWholeKey) {
  EXPECT_EQ(refusal("features.count=-5"), "--set: features.count: -5 is out of range; it must be 1 ... 8000");
  EXPECT_EQ(refusal("experiment.mapping.ba.edge_weight=20"),
            "--set: experiment.mapping.ba.edge_weight: 20 is out of range; it must be above 0, at most 10");
  EXPECT_EQ(refusal("dynamics.filter=paprr"),
            "--set: dynamics.filter: \"paprr\" is not one of none, box, epipolar, multiview, paper, default");
  const auto rejects = [](const std::string& key, auto change) {
    Options options;
    change(options);
    const std::string message = test::input_error_of([&] { options.check(); });
    EXPECT_EQ(message.rfind(key + ": ", 0), 0u) << message;
  };
  rejects("features.count", [](auto& o) { o.features.count = 0; });
  rejects("features.count", [](auto& o) { o.features.count = 100001; });
  rejects("features.fast_threshold", [](auto& o) { o.features.fast_threshold = 5; });
  rejects("noise.pixel_sigma", [](auto& o) { o.noise.pixel_sigma = std::nan(""); });
  rejects("tracking.min_inliers", [](auto& o) { o.tracking.min_inliers = 0; });
  rejects("dense.truncation", [](auto& o) { o.dense.truncation = 3; });
  rejects("dense.grid_cell", [](auto& o) { o.dense.voxel = 0.03, o.dense.truncation = 0.12; });
  rejects("dense.obstacle_high", [](auto& o) { o.dense.obstacle_high = 0.05; });
  rejects("pipeline.mapper_latency", [](auto& o) { o.pipeline.mapper_latency = 0; });
  rejects("pipeline.mapper_latency", [](auto& o) { o.pipeline.mapper_latency = 10.1; });
  rejects("dynamics.filter", [](auto& o) { o.dynamics.filter = static_cast<FilterKind>(99); });
}

TEST(Options, AMountIsARigidMotion) {
  Options options;
  options.base_from_cam.rotation.coeffs() *= 1.005;  // written by hand
  EXPECT_EQ(test::input_error_of([&] { options.check(); }), "no error");
  EXPECT_NEAR(expand(options).base_from_cam.rotation.norm(), 1, 1e-15);
  options.base_from_cam.rotation.coeffs() *= 2;
  EXPECT_EQ(
      test::input_error_of([&] { options.check(); }),
      "base_from_cam: a motion with a quaternion of length 2.010000 is out of range; it must be of finite numbers, "
      "with a quaternion of length 1; normalise it");
  const auto refused = [](const Rigid3& mount) {
    Options with;
    with.base_from_cam = mount;
    return test::input_error_of([&] { with.check(); }).find("base_from_cam: ") == 0;
  };
  const double nan = std::nan("");
  EXPECT_TRUE(refused({Eigen::Quaterniond(0, 0, 0, 0), Eigen::Vector3d::Zero()}));
  EXPECT_TRUE(refused({Eigen::Quaterniond(nan, 0, 0, 0), Eigen::Vector3d::Zero()}));
  EXPECT_TRUE(refused({Eigen::Quaterniond::Identity(), {0, nan, 0}}));
}

TEST(Options, AMisspeltKeyNamesTheNearestOne) {
  EXPECT_EQ(refusal("featurs.count=5"), "--set: unknown key \"featurs.count\" (did you mean \"features.count\"?)");
}

TEST(Options, AKeyOfEarlierVersionsSaysWhatBecameOfIt) {
  EXPECT_EQ(refusal("mapping.ba.edge_weight=2"),
            "--set: \"mapping.ba.edge_weight\" is \"experiment.mapping.ba.edge_weight\" now, and not promised to stay");
}

TEST(Options, AKeyThatIsLikeNoOtherSaysWhereTheyAreListed) {
  EXPECT_EQ(refusal("dense.threads=2"), "--set: unknown key \"dense.threads\"; docs/settings.md lists what can be set");
}

TEST(Presets, OnlyThePapersWeightIsFixed) {
  EXPECT_TRUE(expand(Options("default")).mapping.ba.weights.adaptive);
  EXPECT_FALSE(expand(Options("paper")).mapping.ba.weights.adaptive);
  EXPECT_EQ(expand(Options("paper")).mapping.ba.weights.edge_weight, 1.5);
  EXPECT_TRUE(Options("paper").mapping.ba.weighted);
  EXPECT_FALSE(Options("orb").mapping.ba.weighted);
}

TEST(Presets, AnUnknownOneIsNamed) {
  EXPECT_EQ(test::input_error_of([] { Options("defalt"); }),
            "preset: there is no preset \"defalt\" (did you mean \"default\"?); presets: default, paper, orb");
}

TEST(Options, APartThatIsNotThereIsToldAsTheCallerSays) {
  Options options;
  const std::string what = ": there is no part \"bs\" (did you mean \"ba\"?); parts: dr, kf, ba, loop";
  EXPECT_EQ(test::input_error_of([&] { options.disable("bs"); }), "disable" + what);
  EXPECT_EQ(test::input_error_of([&] { options.disable("bs", "--disable"); }), "--disable" + what);
}

TEST(Options, BlanksAmongDisabledPartsDoNotMatter) {
  Options options;
  options.disable(" kf , ba");
  EXPECT_EQ(options.keyframes.policy, KeyframePolicyKind::baseline);
  EXPECT_FALSE(options.mapping.ba.weighted);
}

TEST(Presets, TheOrbOneIsThePapersWithItsPartsOff) {
  Options paper("paper");
  paper.disable("dr,kf,ba");
  const std::string a = paper.to_yaml(), b = Options("orb").to_yaml();
  EXPECT_EQ(a.substr(a.find('\n')), b.substr(b.find('\n')));
}

}  // namespace
}  // namespace dkb
