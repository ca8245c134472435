// SPDX-License-Identifier: Apache-2.0
#include "parameters.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <sstream>

namespace dkb_ros {
namespace {

const ParameterDescription& description(const std::string& name) {
  const auto& all = parameter_descriptions();
  return *std::find_if(all.begin(), all.end(), [&](const auto& d) { return d.name == name; });
}

TEST(Parameters, EverySettingOfTheLibraryIsOneWithItsTypeAndRange) {
  EXPECT_EQ(std::get<int64_t>(description("features.count").initial), 900);
  EXPECT_EQ(description("features.count").min, 1);
  EXPECT_EQ(description("features.count").meaning, "[features] wanted per image");
  EXPECT_EQ(std::get<double>(description("features.scale").initial), 1.2);
  EXPECT_EQ(description("features.scale").max, 4);
  EXPECT_EQ(std::get<double>(description("tracking.new_map_after").initial), 1);
  EXPECT_TRUE(std::get<bool>(description("loop.enabled").initial));
  EXPECT_EQ(std::get<double>(description("mapping.redundant_share").initial), 0.9);
  EXPECT_EQ(description("mapping.redundant_share").min, 0);
  EXPECT_EQ(description("mapping.ba.free_keyframes").name, "mapping.ba.free_keyframes");
  EXPECT_EQ(std::get<int64_t>(description("seed").initial), 1);
  const std::vector<std::string> filters = {"none", "box", "epipolar", "multiview", "paper", "default"};
  EXPECT_EQ(description("dynamics.filter").choices, filters);
}

TEST(Parameters, DefaultsOfTheTableAreTheDefaults) {
  std::map<std::string, ParameterValue> all;
  for (const ParameterDescription& d : parameter_descriptions()) all.emplace(d.name, d.initial);
  EXPECT_EQ(Parameters::from_values(all).options.to_yaml(), Parameters::from_values({}).options.to_yaml());
  EXPECT_TRUE(Parameters::from_values({}).options.realtime);
}

TEST(Parameters, SettingsReachTheLibraryOnTopOfThePreset) {
  const Parameters p = Parameters::from_values({{"preset", "paper"},
                                                {"features.count", int64_t{1500}},
                                                {"features.scale", int64_t{2}},
                                                {"loop.enabled", false}});
  EXPECT_EQ(p.options.preset(), "paper");
  EXPECT_EQ(p.options.features.count, 1500);
  EXPECT_EQ(p.options.features.scale, 2);
  EXPECT_FALSE(p.options.loop.enabled);
  EXPECT_EQ(p.options.dynamics.filter, dkb::FilterKind::paper);
}

TEST(Parameters, FramesHaveNoLeadingSlash) {
  const Parameters p = Parameters::from_values({{"map_frame", std::string("/map")},
                                                {"odom_frame", std::string("/odom")},
                                                {"base_frame", std::string("/robot/base")},
                                                {"camera_frame", std::string("/camera")}});
  EXPECT_EQ(p.map_frame + " " + p.odom_frame + " " + p.base_frame + " " + p.camera_frame, "map odom robot/base camera");
}

TEST(Parameters, WrongOnesAreRefusedByName) {
  const auto complaint = [](const std::string& name, ParameterValue value) -> std::string {
    try {
      Parameters::from_values({{name, std::move(value)}});
    } catch (const dkb::InputError& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_NE(complaint("features.count", int64_t{0}).find("features.count"), std::string::npos);
  EXPECT_NE(complaint("features.count", std::string("many")).find("features.count"), std::string::npos);
  EXPECT_NE(complaint("sync_tolerance", -1.0).find("sync_tolerance"), std::string::npos);
  EXPECT_NE(complaint("sync_tolerance", 0.3).find("sync_tolerance"), std::string::npos)
      << "the library pairs up to 0.2 s";
  EXPECT_NE(complaint("queue_size", int64_t{0}).find("queue_size"), std::string::npos);
  EXPECT_NE(complaint("prior", std::string("gps")).find("prior"), std::string::npos);
  EXPECT_NE(complaint("base_from_cam", std::vector<double>{1, 2, 3}).find("base_from_cam"), std::string::npos);
  EXPECT_NE(complaint("feature.count", int64_t{5}).find("feature.count"), std::string::npos);
}

TEST(Parameters, ThePageListsThemAsTheyAre) {
  std::ifstream page(DKB_SOURCE_DIR "/docs/ros.md");
  std::ostringstream text;
  text << page.rdbuf();
  EXPECT_NE(text.str().find(parameter_table()), std::string::npos) << "docs/ros.md must hold this table:\n"
                                                                   << parameter_table();
}

}  // namespace
}  // namespace dkb_ros
