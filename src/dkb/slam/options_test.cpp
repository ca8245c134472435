// SPDX-License-Identifier: Apache-2.0
#include "dkb/slam/options.h"

#include <gtest/gtest.h>

#include "dkb/util/errors.h"
#include "dkb/util/test_errors.h"

namespace dkb {
namespace {

TEST(SlamOptions, DefaultsAreInRange) {
  EXPECT_NO_THROW(SlamOptions().check());
}

TEST(SlamOptions, EverySettingSurvivesItsYaml) {
  SlamOptions written, read;
  Settings a, b;
  bind_settings(a, written);
  bind_settings(b, read);
  for (const SettingEntry& e : a.entries()) {
    EXPECT_FALSE(e.doc.empty()) << e.key;
    double number = 0;
    if (e.value == "true" || e.value == "false") {
      a.set(e.key, e.value == "true" ? "false" : "true", "test");
    } else if (parse_number(e.value, &number)) {
      a.set(e.key,
            e.value.find_first_of(".e") == std::string::npos ? std::to_string(static_cast<long>(number) + 1)
                                                             : std::to_string(number * 0.75),
            "test");
    }
  }
  EXPECT_NE(a.to_yaml(), b.to_yaml());
  b.load_yaml_text(a.to_yaml(), "config.yaml");
  EXPECT_EQ(a.to_yaml(), b.to_yaml());
}

TEST(SlamOptions, SettingsReachTheirFields) {
  SlamOptions options;
  Settings settings;
  bind_settings(settings, options);
  settings.set_assignment("features.count=777", "--set");
  settings.set_assignment("tracking.close_depth=2.5", "--set");
  settings.set_assignment("mapping.ba.weighted=false", "--set");
  settings.set_assignment("pipeline.mapper_latency=3", "--set");
  settings.set_assignment("dynamics.motion.settle=0.75", "--set");
  settings.set_assignment("dynamics.motion.smoothing.distance=0.3", "--set");
  EXPECT_EQ(options.features.count, 777);
  EXPECT_EQ(options.tracking.close_depth, 2.5);
  EXPECT_FALSE(options.mapping.ba.weighted);
  EXPECT_EQ(options.pipeline.mapper_latency, 3);
  EXPECT_EQ(options.dynamics.motion.settle, 0.75);
  EXPECT_EQ(options.dynamics.motion.smoothing.distance, 0.3);
}

TEST(SlamOptions, AMisspeltSettingNamesTheNearestOne) {
  SlamOptions options;
  Settings settings;
  bind_settings(settings, options);
  const std::string message = test::input_error_of([&] { settings.set_assignment("featurs.count=5", "--set"); });
  EXPECT_NE(message.find("featurs.count"), std::string::npos) << message;
  EXPECT_NE(message.find("features.count"), std::string::npos) << message;
}

TEST(SlamOptions, ValuesOutOfRangeAreRejectedWhereverTheyStand) {
  const auto rejects = [](auto change) {
    SlamOptions options;
    change(options);
    EXPECT_THROW(options.check(), InvalidOption);
  };
  rejects([](auto& o) { o.features.count = 0; });
  rejects([](auto& o) { o.depth.edge_fraction = 0; });
  rejects([](auto& o) { o.noise.pixel_sigma = 0; });
  rejects([](auto& o) { o.tracking.min_inliers = 0; });
  rejects([](auto& o) { o.baseline_keyframes.frames_between = 0; });
  rejects([](auto& o) { o.mapping.min_observers = 0; });
  rejects([](auto& o) { o.pipeline.mapper_latency = 0; });
  rejects([](auto& o) { o.pipeline.mapper_queue = 0; });
}

TEST(Presets, OnlyThePapersWeightIsFixed) {
  EXPECT_TRUE(preset("default").mapping.ba.weights.adaptive);
  EXPECT_FALSE(preset("paper").mapping.ba.weights.adaptive);
  EXPECT_EQ(preset("paper").mapping.ba.weights.edge_weight, 1.5);
  EXPECT_TRUE(preset("paper").mapping.ba.weighted);
  EXPECT_FALSE(preset("orb").mapping.ba.weighted);
}

TEST(Presets, AnUnknownOneIsNamed) {
  EXPECT_NO_THROW(preset("default").check());
  EXPECT_NE(test::input_error_of([] { preset("defalt"); }).find("default"), std::string::npos);
}

}  // namespace
}  // namespace dkb
